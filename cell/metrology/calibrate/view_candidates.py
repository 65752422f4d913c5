"""Views of a board that could be taken: the camera leans and rolls over it, near and far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array, Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardPose, pose_information
from cell.metrology.calibrate.detect_board import BoardDesign

GOLDEN = np.array([0.8191725134, 0.6710436067, 0.5497004779, 0.4503000000, 0.3688000000])
"""Steps of a sequence that fills five dimensions evenly (R. Kronecker's, powers of 1/1.2207)."""
EDGE = 8.0     # px of the image in which no corner counts
FEWEST = 0.4   # of the corners must be in the picture


@dataclass(frozen=True)
class Spread:
    """How far the views differ: degrees, the distances (mm) about the working one, and sideways."""

    lean_deg: float = 32.0
    roll_deg: float = 90.0
    depth_mm: float = 22.0
    aside_mm: float = 6.0


def draw_candidates(count: int, design: BoardDesign, camera: CameraModel, distance: float,
                    spread: Spread) -> list[Transform]:
    """Draw `camera_from_board` of views that show enough of the board, evenly spread."""
    drawn = (_draw(index, design, camera, distance, spread) for index in range(1, 3 * count))
    seen = [pose for pose in drawn
            if len(visible_corners(pose, design, camera)) >= FEWEST * design.corners]
    return seen[:count]


def visible_corners(camera_from_board: Transform, design: BoardDesign,
                    camera: CameraModel) -> Array:
    """Predict which inner corners (n, 3) fall into the picture."""
    columns, rows = design.squares
    grid = np.stack(np.meshgrid(np.arange(1, columns), np.arange(1, rows)), -1).reshape(-1, 2)
    points = np.hstack([grid * design.square_mm, np.zeros((len(grid), 1))])
    pixels = camera.project(camera_from_board @ points)
    inside = (pixels > EDGE) & (pixels < np.array(camera.image_size) - 1 - EDGE)
    return points[inside.all(axis=1)]


def predict_board(camera_from_board: Transform, design: BoardDesign, camera: CameraModel,
                  corner_sigma: float) -> BoardPose:
    """Predict how well a board pose would be known."""
    points = visible_corners(camera_from_board, design, camera)
    information = pose_information(points, camera_from_board, camera, corner_sigma)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return BoardPose(camera_from_board, covariance, points, np.zeros((len(points), 2)))


def _draw(index: int, design: BoardDesign, camera: CameraModel, distance: float,
          spread: Spread) -> Transform:
    lean, about, roll, depth, aside = np.mod(index * GOLDEN, 1.0)
    direction = 2.0 * np.pi * about
    turn = (Rotation.from_rotvec(np.radians(spread.lean_deg) * np.sqrt(lean)
                                 * np.array([np.cos(direction), np.sin(direction), 0.0]))
            * Rotation.from_euler("z", (2.0 * roll - 1.0) * spread.roll_deg, degrees=True))
    far = distance + (2.0 * depth - 1.0) * spread.depth_mm
    middle = camera.rays((np.array(camera.image_size) - 1.0) / 2.0) * far
    off = spread.aside_mm * np.array([np.cos(17.0 * aside), np.sin(17.0 * aside), 0.0]) * aside
    return Transform.from_parts(turn.as_matrix(), middle + off - turn.apply(design.middle))
