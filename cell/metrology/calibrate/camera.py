"""The camera's matrix and distortion from views of a board, and what they are worth.

Z. Zhang, IEEE PAMI 22 (2000) 1330, as OpenCV has it, with k1, k2, p1, p2 (k3 is held). The
covariance keeps the correlations: the board poses are eliminated view by view, so that it is that
of the camera alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array, Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_blur import LensBlur
from cell.metrology.calibrate.board_pose import BoardView, corner_sigma

FEWEST_VIEWS, FEWEST_CORNERS = 4, 6
GRID = 8                          # cells of the coverage map, each way
TILTED = np.radians(20.0)         # a view that leans so much fixes the focal length
FREE = 8                          # of the nine parameters: k3 is held
CONVERGED = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-10)


@dataclass(frozen=True, eq=False)
class CameraResult:
    """A calibrated camera: `covariance` (9, 9) of fx, fy, cx, cy, k1, k2, p1, p2, k3 (px, 1).

    `residuals` are the misses (n, 2) px of each view, `coverage` (8, 8) the corners seen in each
    cell of the image, `tilts` (rad) how far each board leaned, `split_half` the relative difference
    of the focal length between even and odd views (NaN where a half is too small). `blur`
    is how soft it draws a sharp edge; None where only corners were given, or few edges were clear.
    """

    camera: CameraModel
    covariance: Array
    residuals: tuple[Array, ...]
    camera_from_board: tuple[Transform, ...]
    coverage: Array
    split_half: float
    blur: LensBlur | None = None

    @property
    def rms_px(self) -> float:
        """The distance between seen and projected corners, root mean square."""
        return float(np.sqrt(np.mean(np.sum(np.concatenate(self.residuals) ** 2, axis=1))))

    @property
    def softness(self) -> str:
        """How soft a sharp edge appears, in words."""
        if self.blur is None:
            return ("how soft a sharp edge appears is not known: too few clear edges between black "
                    "and white squares; a soft lens and a rounded rim will look alike")
        return str(self.blur)

    @property
    def tilts(self) -> Array:
        """The angle (rad) between each board's normal and the optic axis."""
        return np.arccos([min(1.0, abs(pose.rotation[2, 2])) for pose in self.camera_from_board])

    @property
    def covered(self) -> float:
        """The share of the image's cells in which a corner was seen."""
        return float(np.mean(self.coverage > 0))


def solve_camera(views: Sequence[BoardView], image_size: tuple[int, int],
                 start: CameraModel | None = None) -> CameraResult:
    """Solve the camera from views of a flat board; k3 stays at that of `start`, or at zero.

    Raises:
        UnmeasurableError: `too_few_views`, `no_camera`.
    """
    camera, poses, residuals = _solve(views, image_size, start)
    return CameraResult(camera, _covariance(views, camera, poses, corner_sigma(residuals)),
                        tuple(residuals), tuple(poses), coverage(views, image_size),
                        split_half_focal(views, camera))


def split_half_focal(views: Sequence[BoardView], start: CameraModel) -> float:
    """Compare the focal length of the even with that of the odd views: relative difference."""
    try:
        even, odd = (_solve(half, start.image_size, start)[0].matrix[0, 0]
                     for half in (views[::2], views[1::2]))
    except UnmeasurableError:
        return float("nan")
    return float(abs(even - odd) / start.matrix[0, 0])


def coverage(views: Sequence[BoardView], image_size: tuple[int, int]) -> Array:
    """Count the corners in each of 8 x 8 cells of the image, row by row."""
    pixels = np.concatenate([view.pixels for view in views])
    width, height = image_size
    counts, _, _ = np.histogram2d(pixels[:, 1], pixels[:, 0], bins=GRID,
                                  range=((-0.5, height - 0.5), (-0.5, width - 0.5)))
    return counts


def _solve(views: Sequence[BoardView], image_size: tuple[int, int], start: CameraModel | None,
           ) -> tuple[CameraModel, list[Transform], list[Array]]:
    if len(views) < FEWEST_VIEWS or min(len(view.pixels) for view in views) < FEWEST_CORNERS:
        raise UnmeasurableError("too_few_views", f"a camera needs {FEWEST_VIEWS} views of "
                                                 f"{FEWEST_CORNERS} corners")
    flags = cv2.CALIB_FIX_K3 | (cv2.CALIB_USE_INTRINSIC_GUESS if start else 0)
    points = [view.points_in_board.astype(np.float32) for view in views]
    pixels = [view.pixels.astype(np.float32) for view in views]
    try:
        _, matrix, distortion, turns, shifts, *_ = cv2.calibrateCameraExtended(
            points, pixels, image_size, start.matrix.copy() if start else np.eye(3),
            start.distortion.copy() if start else np.zeros(5), flags=flags, criteria=CONVERGED)
    except cv2.error as error:
        raise UnmeasurableError("no_camera", "the views do not determine a camera") from error
    camera = CameraModel(image_size, matrix, distortion.ravel()[:5])
    poses = [Transform.from_parts(turn.ravel(), shift.ravel())
             for turn, shift in zip(turns, shifts, strict=True)]
    return camera, poses, [camera.project(pose @ view.points_in_board) - view.pixels
                           for pose, view in zip(poses, views, strict=True)]


def _covariance(views: Sequence[BoardView], camera: CameraModel, poses: Sequence[Transform],
                sigma: float) -> Array:
    information = sum(_information(view, camera, pose)
                      for view, pose in zip(views, poses, strict=True))
    full = np.zeros((9, 9))
    full[:FREE, :FREE] = np.linalg.inv(np.asarray(information)) * sigma ** 2
    return full


def _information(view: BoardView, camera: CameraModel, pose: Transform) -> Array:
    """What one view tells of the free parameters, its board pose eliminated (Schur)."""
    _, jacobian = cv2.projectPoints(view.points_in_board, pose.rotation_vector,
                                    pose.translation, camera.matrix, camera.distortion)
    of_pose, of_camera = jacobian[:, :6], jacobian[:, 6:6 + FREE]
    explained = of_pose @ np.linalg.lstsq(of_pose, of_camera, rcond=None)[0]
    return of_camera.T @ (of_camera - explained)
