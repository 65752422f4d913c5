"""Hand-eye: where the camera sits, from views of a board that stands still.

Each view is weighed by how well its board pose (PnP) and the reached robot pose are known, and the
twelve unknowns are fitted by robust least squares. Plain reprojection, which is the usual
choice, lets the robot's error pass for corner noise and bends the result to absorb it.

One formulation serves both mounts: `reference_from_carrier @ carrier_from_camera @
camera_from_board` is the constant `reference_from_board`.

| mount | carrier | reference | unknown `carrier_from_camera` |
|---|---|---|---|
| `flange`: camera on the robot | flange | base | `flange_from_camera` |
| `static`: board on the robot | base | flange | `base_from_camera` |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from scipy.optimize import least_squares

from cell.core.geometry import Array, Transform
from cell.metrology.calibrate.board_pose import BoardPose
from cell.metrology.calibrate.hand_eye.start import solve_park
from cell.metrology.calibrate.working_volume import point_sigma
from cell.metrology.motions import (
    adjoint,
    inverse,
    nearest_rotation,
    nudge,
    nudge_as_motion,
    small,
    stack,
)

Mount: TypeAlias = Literal["flange", "static"]

UNKNOWNS = 12
FEWEST_VIEWS = 6         # below that nothing is solved
ROBUST_FROM = 2.5        # standard deviations: from there the loss grows more slowly
OUTLIER_RATIO = 4.0      # of a view's misfit to the median
MOST_DROPPED = 0.2       # of the views


@dataclass(frozen=True)
class RobotNoise:
    """The standard uncertainty of a reached flange pose, per axis."""

    translation_mm: float = 0.05
    rotation_deg: float = 0.01

    @property
    def variances(self) -> Array:
        """Of a small motion of the flange: three rotations (rad²), three translations (mm²)."""
        return np.repeat([np.radians(self.rotation_deg) ** 2, self.translation_mm ** 2], 3)


@dataclass(frozen=True, eq=False)
class HandEyeView:
    """One view: the flange pose as reached, and the board as seen from there."""

    base_from_flange: Transform
    board: BoardPose


@dataclass(frozen=True, eq=False)
class HandEyeProblem:
    """Views of one board, how the camera is mounted, and what the robot's poses are worth."""

    views: tuple[HandEyeView, ...]
    mount: Mount = "flange"
    noise: RobotNoise = RobotNoise()

    @property
    def reference_from_carrier(self) -> Array:
        """The reached poses (n, 4, 4), in the direction that the mount asks for."""
        base_from_flange = stack(view.base_from_flange for view in self.views)
        return base_from_flange if self.mount == "flange" else inverse(base_from_flange)

    @property
    def camera_from_board(self) -> Array:
        """The board poses (n, 4, 4)."""
        return stack(view.board.camera_from_board for view in self.views)

    def take(self, indices: Sequence[int]) -> HandEyeProblem:
        """Keep the views of these indices, in this order."""
        return replace(self, views=tuple(self.views[index] for index in indices))


@dataclass(frozen=True, eq=False)
class HandEyeResult:
    """The solution: `carrier_from_camera` and `reference_from_board` (see the module's table).

    `covariance` (12, 12) is over a small rotation (rad) and shift (mm) of the camera in the carrier
    frame, then of the board in the reference frame, already multiplied by `chi2` where that is
    above one. `used` are the views of the fit; of all views there are `shifts` (n, 6), the small
    motions in the board frame by which they miss, and, divided by the `roots` (n, 6, 6) of their
    covariances, `whitened` (n, 6) and `jacobian` (n, 6, 12).
    """

    mount: Mount
    carrier_from_camera: Transform
    reference_from_board: Transform
    covariance: Array
    chi2: float
    used: tuple[int, ...]
    shifts: Array
    roots: Array
    whitened: Array
    jacobian: Array

    @property
    def misfits(self) -> Array:
        """How far (n,) each view is off, in standard deviations."""
        return np.sqrt(np.sum(self.whitened ** 2, axis=1))

    @property
    def dropped(self) -> tuple[int, ...]:
        """The views that were left out because they contradict the others."""
        return tuple(sorted(set(range(len(self.misfits))) - set(self.used)))

    def point_sigma(self, working_distance: float) -> float:
        """Predict how far (mm, rms in 3D) a point of the working volume is carried wrongly."""
        return point_sigma(self.covariance[:6, :6], self.carrier_from_camera, working_distance)

    @property
    def rotation_sigma(self) -> float:
        """The largest standard uncertainty (rad) of the camera's orientation about any axis."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))


def solve_hand_eye(problem: HandEyeProblem) -> HandEyeResult:
    """Solve by maximum likelihood from Park's closed form; leave out views that contradict.

    A view is left out when its misfit exceeds four times the median, at most one in five, and it is
    named in `dropped`.

    Raises:
        ValueError: fewer than six views.
    """
    if len(problem.views) < FEWEST_VIEWS:
        raise ValueError(f"hand-eye needs {FEWEST_VIEWS} views")
    first = _solve(problem, range(len(problem.views)))
    keep = _agreeing(first.misfits)
    return first if len(keep) == len(problem.views) else _solve(problem, keep)


def residuals_of(problem: HandEyeProblem, carrier_from_camera: Transform,
                 reference_from_board: Transform) -> Array:
    """Form the small motions (n, 6) in the board frame that separate each view from the rest."""
    return small(inverse(reference_from_board.matrix) @ problem.reference_from_carrier
                 @ carrier_from_camera.matrix @ problem.camera_from_board)


def whiten(roots: Array, columns: Array) -> Array:
    """Divide columns (n, 6, k) by the roots (n, 6, 6) of each view's covariance."""
    return np.asarray(np.linalg.solve(roots, columns), dtype=np.float64)


def view_information(problem: HandEyeProblem, carrier_from_camera: Transform,
                     reference_from_board: Transform) -> Array:
    """Predict what each view tells of the twelve unknowns: (n, 12, 12)."""
    jacobian = whiten(_roots(problem, carrier_from_camera),
                      _jacobian(problem, carrier_from_camera, reference_from_board))
    return np.swapaxes(jacobian, -1, -2) @ jacobian


def _solve(problem: HandEyeProblem, keep: Sequence[int]) -> HandEyeResult:
    chosen = problem.take(keep)
    camera = solve_park(chosen.reference_from_carrier, chosen.camera_from_board)
    board = _mean(chosen.reference_from_carrier @ camera.matrix @ chosen.camera_from_board)
    for _ in range(2):  # the weights depend a little on the solution
        camera, board = _fit(chosen, camera, board)
    return _result(problem, tuple(keep), camera, board)


def _fit(problem: HandEyeProblem, camera: Transform,
         board: Transform) -> tuple[Transform, Transform]:
    roots = _roots(problem, camera)

    def moved(step: Array) -> tuple[Transform, Transform]:
        return nudge(camera, step[:6]), nudge(board, step[6:])

    def residual(step: Array) -> Array:
        return whiten(roots, residuals_of(problem, *moved(step))[..., None]).ravel()

    def jacobian(step: Array) -> Array:
        return whiten(roots, _jacobian(problem, *moved(step))).reshape(-1, UNKNOWNS)

    spread = max(1.0, 1.4826 * float(np.median(np.abs(residual(np.zeros(UNKNOWNS))))))
    fit = least_squares(residual, np.zeros(UNKNOWNS), jacobian, x_scale="jac", loss="soft_l1",
                        f_scale=ROBUST_FROM * spread, max_nfev=60)
    return moved(fit.x)


def _result(problem: HandEyeProblem, used: tuple[int, ...], camera: Transform,
            board: Transform) -> HandEyeResult:
    shifts = residuals_of(problem, camera, board)
    roots = _roots(problem, camera)
    whitened = whiten(roots, shifts[..., None])[..., 0]
    jacobian = whiten(roots, _jacobian(problem, camera, board))
    rows, of = jacobian[list(used)].reshape(-1, UNKNOWNS), whitened[list(used)]
    chi2 = float(np.sum(of ** 2)) / (of.size - UNKNOWNS)
    covariance = max(1.0, chi2) * np.asarray(np.linalg.pinv(rows.T @ rows, hermitian=True),
                                             dtype=np.float64)
    return HandEyeResult(problem.mount, camera, board, covariance, chi2, used, shifts, roots,
                         whitened, jacobian)


def _roots(problem: HandEyeProblem, carrier_from_camera: Transform) -> Array:
    """Form lower roots (n, 6, 6) of each view's covariance: its board pose and the robot's pose."""
    flange_from_board = _flange_from_board(problem, carrier_from_camera)
    robot = adjoint(inverse(flange_from_board))
    spread = np.einsum("nij,j,nkj->nik", robot, problem.noise.variances, robot)
    seen = np.array([view.board.covariance for view in problem.views])
    return np.asarray(np.linalg.cholesky(spread + seen), dtype=np.float64)


def _flange_from_board(problem: HandEyeProblem, carrier_from_camera: Transform) -> Array:
    seen = carrier_from_camera.matrix @ problem.camera_from_board
    if problem.mount == "flange":
        return seen
    return problem.reference_from_carrier @ seen


def _jacobian(problem: HandEyeProblem, camera: Transform, board: Transform) -> Array:
    """Differentiate the residuals by nudges of camera and board: (n, 6, 12)."""
    back = adjoint(inverse(camera.matrix @ problem.camera_from_board)) @ nudge_as_motion(camera)
    rest = adjoint(inverse(board.matrix)) @ nudge_as_motion(board)
    return np.concatenate([back, np.broadcast_to(-rest, back.shape)], axis=2)


def _mean(motions: Array) -> Transform:
    return Transform.from_parts(nearest_rotation(motions[:, :3, :3].sum(axis=0)),
                                np.median(motions[:, :3, 3], axis=0))


def _agreeing(misfits: Array) -> list[int]:
    order = np.argsort(misfits)
    fewest = int(np.ceil(len(misfits) * (1.0 - MOST_DROPPED)))
    limit = OUTLIER_RATIO * float(np.median(misfits))
    return sorted(int(index) for place, index in enumerate(order)
                  if place < fewest or misfits[index] <= limit)
