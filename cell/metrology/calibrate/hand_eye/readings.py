"""The ways in which a recorded session is commonly misread, and how well each would fit.

A reading is judged by Park's closed form with the scale between robot and board left free, so that
a wrong length unit never hides a wrong convention, and by the median over the views, so that one
bad view does not hide it either. Readings are evidence: nothing is corrected by them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array
from cell.metrology.arrays import Indices
from cell.metrology.calibrate.hand_eye.conventions import (
    choose_branches,
    other_meanings,
    turns_between,
)
from cell.metrology.calibrate.hand_eye.solve import Mount
from cell.metrology.calibrate.hand_eye.start import pairs, useful_pairs
from cell.metrology.motions import inverse, nearest_rotation, rotation_vectors

LEVER = 50.0        # mm: a rotation counts by what it moves at the edge of a board
SHIFTS = (1, -1, 2, -2, 3, -3)
SWAPS_TRIED = 3
FEWEST_COMMON = 4   # views that a shift must leave


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read the lists of robot poses and board poses, (n, 4, 4) each.

    The boards' origin is in their middle, so that a miss is one of the board and not of its corner.
    `numbers` are the views' names in sentences.
    """

    code: str
    says: str
    base_from_flange: Array
    camera_from_board: Array
    mount: Mount
    numbers: tuple[int, ...] = ()

    @property
    def distance(self) -> float:
        """How far (mm) the board was from the camera, on average."""
        return float(self.camera_from_board[:, 2, 3].mean())

    def without(self, indices: Sequence[int]) -> Reading:
        """Leave out some views."""
        return replace(self, base_from_flange=np.delete(self.base_from_flange, indices, axis=0),
                       camera_from_board=np.delete(self.camera_from_board, indices, axis=0))

    @property
    def reference_from_carrier(self) -> Array:
        """The robot's poses in the direction that the mount asks for."""
        return self.base_from_flange if self.mount == "flange" else inverse(self.base_from_flange)


@dataclass(frozen=True)
class Fit:
    """How well a reading fits: the median view's miss (mm of the board), and robot per board."""

    miss: float
    scale: float


def fit_reading(reading: Reading) -> Fit:
    """Fit in closed form with free scale: `scale` is the board's true size over the entered one."""
    M, B = reading.reference_from_carrier, reading.camera_from_board
    try:
        rotation, shift, scale = _park_with_scale(M, B)
    except np.linalg.LinAlgError:
        return Fit(np.inf, np.nan)
    if not scale > 0.0:
        return Fit(np.inf, scale)
    camera = np.eye(4)
    camera[:3, :3], camera[:3, 3] = rotation, shift / scale
    resized = M.copy()
    resized[:, :3, 3] /= scale
    return Fit(_spread(resized @ camera @ B), scale)


def other_readings(given: Reading) -> Iterator[Reading]:
    """List how the same lists could be meant otherwise."""
    robot, boards = given.base_from_flange, given.camera_from_board
    yield replace(given, code="poses_inverted", base_from_flange=inverse(robot),
                  says="the poses look inverted: the robot's seem to give flange_from_base, or the "
                       "board's board_from_camera, or the camera is mounted the other way")
    yield from _shifted(given)
    yield from _swapped(given)
    yield replace(given, code="lists_reversed", camera_from_board=boards[::-1],
                  says="image and pose lists do not belong together: one of them runs backwards")
    seen = _pair_turns(boards)
    for meant, candidates in other_meanings(robot[:, :3, :3]):
        poses = robot.copy()
        poses[:, :3, :3] = choose_branches(candidates, seen)
        yield replace(given, code="rotation_convention", base_from_flange=poses,
                      says=f"rotation convention: the robot's rotations look like {meant}")


def angle_gap(given: Reading) -> float:
    """Compare the turns of robot and camera between every two views: median difference (rad)."""
    A, B = pairs(given.reference_from_carrier, given.camera_from_board)
    return float(np.median(np.abs(np.linalg.norm(rotation_vectors(A), axis=1)
                                  - np.linalg.norm(rotation_vectors(B), axis=1))))


def _shifted(given: Reading) -> Iterator[Reading]:
    """Shift one list against the other; what falls off the end is left out."""
    robot, boards = given.base_from_flange, given.camera_from_board
    for shift in SHIFTS:
        if len(robot) - abs(shift) >= FEWEST_COMMON:
            poses, seen = ((robot[shift:], boards[:-shift]) if shift > 0
                           else (robot[:shift], boards[-shift:]))
            yield replace(given, code="lists_shifted", base_from_flange=poses,
                          camera_from_board=seen,
                          says="image and pose lists do not belong together: image i seems to go "
                               f"with pose i{shift:+d}")


def _swapped(given: Reading) -> Iterator[Reading]:
    """Exchange two views: those that make the turns of robot and camera agree best."""
    turns, seen = _pair_turns(given.base_from_flange), _pair_turns(given.camera_from_board)

    def gap(order: Indices) -> float:
        return float(np.mean(np.abs(turns - seen[np.ix_(order, order)])))

    count = len(turns)
    orders = [_exchanged(count, i, j) for i, j in combinations(range(count), 2)]
    for order in sorted(orders, key=gap)[:SWAPS_TRIED]:
        i, j = np.flatnonzero(order != np.arange(count))
        yield replace(given, code="views_swapped",
                      camera_from_board=given.camera_from_board[order],
                      says=f"views {given.numbers[i]} and {given.numbers[j]} look exchanged")


def _park_with_scale(M: Array, B: Array) -> tuple[Array, Array, float]:
    A, B = useful_pairs(M, B)
    rotation = nearest_rotation(rotation_vectors(A).T @ rotation_vectors(B))
    rows = np.concatenate([A[:, :3, :3] - np.eye(3),
                           -(B[:, :3, 3] @ rotation.T)[..., None]], axis=2).reshape(-1, 4)
    solution = np.linalg.lstsq(rows, -A[:, :3, 3].ravel(), rcond=None)[0]
    return rotation, solution[:3], float(solution[3])


def _spread(boards: Array) -> float:
    """The median view's distance (mm) from the median board, its turn counted at the lever."""
    middle = nearest_rotation(np.median(boards[:, :3, :3], axis=0))
    turns = Rotation.from_matrix(boards[:, :3, :3] @ middle.T).magnitude()
    shifts = np.linalg.norm(boards[:, :3, 3] - np.median(boards[:, :3, 3], axis=0), axis=1)
    return float(np.median(np.hypot(shifts, LEVER * turns)))


def _pair_turns(poses: Array) -> Array:
    """The angle (n, n) between every two views, which is the same from either end."""
    turns = poses[:, :3, :3]
    return turns_between(turns[:, None], turns[None])


def _exchanged(count: int, i: int, j: int) -> Indices:
    order = np.arange(count)
    order[[i, j]] = j, i
    return order
