"""Boards carried to the base: where one stands, and how still it stands from view to view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.motions import lay_onto
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.seen import SeenView


def place_boards(views: Sequence[SeenView], camera: CameraModel, chain: Chain) -> list[Transform]:
    """Say where the board of each view stands: `base_from_board`, by that view alone."""
    boards = locate_boards([view.board for view in views], camera)
    return [chain.base_from_camera(view.record.pose, view.record.joints) @ board.camera_from_board
            for view, board in zip(views, boards, strict=True)]


def mean_plane(views: Sequence[SeenView], camera: CameraModel, chain: Chain) -> Plane:
    """Lay the plane of one board, in the base, through where the views have it on average."""
    three = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0]])
    origin, along, down = np.mean([base_from_board @ three for base_from_board
                                   in place_boards(views, camera, chain)], axis=0)
    return Plane.through(origin, np.cross(along - origin, down - origin))


def measure_misses(views: Sequence[SeenView], camera: CameraModel, chain: Chain) -> Array:
    """Hold the corners of every view, in the base, against the board laid onto all of them.

    Returns the miss (n,) of each view, mm rms.
    """
    corners = [view.board.points_in_board for view in views]
    carried = [base_from_board @ points for base_from_board, points
               in zip(place_boards(views, camera, chain), corners, strict=True)]
    mean = lay_onto(np.concatenate(corners), np.concatenate(carried))
    return np.array([np.sqrt(np.mean(np.sum((some - mean @ points) ** 2, axis=1)))
                     for some, points in zip(carried, corners, strict=True)])


def measure_scatter(views: Sequence[SeenView], camera: CameraModel, chain: Chain) -> float:
    """Say how far the middle of a board moves between the views of its place: mm, rms."""
    middle = np.concatenate([view.board.points_in_board for view in views]).mean(axis=0)
    places: dict[int, list[Array]] = {}
    for view, base_from_board in zip(views, place_boards(views, camera, chain), strict=True):
        places.setdefault(view.record.place, []).append(base_from_board @ middle)
    off = np.concatenate([np.array(points) - np.mean(points, axis=0)
                          for points in places.values()])
    return float(np.sqrt(np.mean(np.sum(off ** 2, axis=1))))


def measure_shift(before: SeenView, again: SeenView, camera: CameraModel, chain: Chain) -> float:
    """Say how far (mm) the board has moved between two views from one place.

    The board pose of the first, seen from where the arm stands now, is held against the corners:
    what a picture tells across the line of sight is some ten times better than along it.
    """
    (base_from_board,) = place_boards([before], camera, chain)
    base_from_camera = chain.base_from_camera(again.record.pose, again.record.joints)
    camera_from_board = base_from_camera.inverse @ base_from_board
    misses = camera.project(camera_from_board @ again.board.points_in_board) - again.board.pixels
    distance = float(camera_from_board.translation[2])
    return float(np.linalg.norm(misses.mean(axis=0))) * distance / float(camera.matrix[0, 0])
