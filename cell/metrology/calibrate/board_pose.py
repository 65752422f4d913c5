"""Where a flat board stands before the camera, and how well that is known.

Start: IPPE, which gives both poses that a flat target may have (T. Collins, A. Bartoli, IJCV 109
(2014) 252). Refinement: Levenberg-Marquardt on the pixels. Covariances are over a small rotation
(rad) and translation (mm) in the board's own frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array, Transform
from cell.core.optics import CameraModel
from cell.metrology.motions import nudge

FEWEST_CORNERS = 6
ON_A_LINE = 0.02        # breadth of the corners over their length
AMBIGUOUS_RATIO = 2.0   # of the pixel residuals of the two poses
LEAST_CORNER_SIGMA = 0.02  # px: no detector is better, however few corners agree by chance
STEP = 1e-6             # of the numerical derivative, rad and mm


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners seen of a board: `points_in_board` (n, 3) mm with z = 0, `pixels` (n, 2)."""

    points_in_board: Array
    pixels: Array

    @property
    def carries_pose(self) -> bool:
        """Whether there are enough corners, and they do not lie on a line."""
        return len(self.pixels) >= FEWEST_CORNERS and all(
            _breadth(points) > ON_A_LINE for points in (self.points_in_board, self.pixels))


@dataclass(frozen=True, eq=False)
class BoardPose:
    """A board before the camera: `points_in_board` (n, 3) are the corners it was found by.

    `covariance` (6, 6) is in the board frame. `alternative` is the other pose of a flat target
    where the picture hardly tells the two apart.
    """

    camera_from_board: Transform
    covariance: Array
    points_in_board: Array
    residuals: Array
    alternative: BoardPose | None = None

    @property
    def rms_px(self) -> float:
        """The distance between seen and projected corners, root mean square."""
        return float(np.sqrt(np.mean(np.sum(self.residuals ** 2, axis=1))))

    @property
    def tilt(self) -> float:
        """The angle (rad) between the board's normal and the optic axis."""
        return float(np.arccos(min(1.0, abs(self.camera_from_board.rotation[2, 2]))))


def locate_boards(views: Sequence[BoardView], camera: CameraModel) -> list[BoardPose]:
    """Locate the board in every view; the corner noise is estimated over all of them.

    Raises:
        UnmeasurableError: `too_few_corners`, `no_pose`.
    """
    found = [_both_poses(view, camera) for view in views]
    sigma = corner_sigma([poses[0][1] for poses in found])
    return [_with_covariance(view, poses, camera, sigma)
            for view, poses in zip(views, found, strict=True)]


def corner_sigma(residuals: Sequence[Array]) -> float:
    """Estimate the standard deviation (px, per axis) of a corner from the views' residuals."""
    squares = sum(float(np.sum(residual ** 2)) for residual in residuals)
    freedom = sum(2 * len(residual) - 6 for residual in residuals)
    return max(LEAST_CORNER_SIGMA, float(np.sqrt(squares / max(1, freedom))))


def pose_information(points_in_board: Array, camera_from_board: Transform,
                     camera: CameraModel, sigma: float) -> Array:
    """Predict the information (6, 6) that corners carry of the board's pose, in its own frame."""
    jacobian = _pixels_per_motion(points_in_board, camera_from_board, camera)
    return jacobian.T @ jacobian / sigma ** 2


def _both_poses(view: BoardView, camera: CameraModel) -> list[tuple[Transform, Array]]:
    if not view.carries_pose:
        raise UnmeasurableError("too_few_corners", f"{len(view.pixels)} corners; a board pose "
                                                   f"needs {FEWEST_CORNERS}, not on one line")
    rays = camera.normalise(view.pixels)
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        view.points_in_board, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    refined = [_refine(view, rays, turn, shift)
               for turn, shift in zip(turns, shifts, strict=True)] if count else []
    poses = [(pose, camera.project(pose @ view.points_in_board) - view.pixels)
             for pose in refined if pose]
    good = [pose for pose in poses if np.isfinite(pose[1]).all()]
    if not good:
        raise UnmeasurableError("no_pose", "the corners do not fit a flat board")
    return sorted(good, key=_misfit)


def _refine(view: BoardView, rays: Array, turn: Array, shift: Array) -> Transform | None:
    """Refine on undistorted pixels: the same corners, without the distortion's slow inverse."""
    turn, shift = cv2.solvePnPRefineLM(view.points_in_board, rays, np.eye(3), None, turn, shift)
    if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
        return None
    return Transform.from_parts(turn.ravel(), shift.ravel())


def _with_covariance(view: BoardView, poses: list[tuple[Transform, Array]], camera: CameraModel,
                     sigma: float) -> BoardPose:
    def pose(of: tuple[Transform, Array], alternative: BoardPose | None = None) -> BoardPose:
        information = pose_information(view.points_in_board, of[0], camera, sigma)
        try:
            covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise UnmeasurableError("no_pose", "the camera folds the board's image") from None
        return BoardPose(of[0], covariance, view.points_in_board, of[1], alternative)

    if len(poses) > 1 and _misfit(poses[1]) < AMBIGUOUS_RATIO ** 2 * _misfit(poses[0]):
        return pose(poses[0], pose(poses[1]))
    return pose(poses[0])


def _breadth(points: Array) -> float:
    """How broad points (n, 2 or 3) lie, over how long; 0 where all are one point."""
    length, breadth, *_ = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(breadth / length) if length > 0.0 else 0.0


def _misfit(pose: tuple[Transform, Array]) -> float:
    return float(np.sum(pose[1] ** 2))


def _pixels_per_motion(points: Array, camera_from_board: Transform, camera: CameraModel) -> Array:
    columns = []
    for axis in np.eye(6) * STEP:
        ahead, back = (camera.project(camera_from_board @ nudge(Transform.identity(), step)
                                      @ points) for step in (axis, -axis))
        columns.append((ahead - back).ravel() / (2 * STEP))
    return np.stack(columns, axis=1)
