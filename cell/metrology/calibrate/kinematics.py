"""The arm's own geometry from board views: residuals of the Denavit-Hartenberg rows, with priors.

The residuals that the board cannot see are held at zero by their priors. The camera's place on the
flange and one pose a board are estimated along; the last joint's rows and the camera's place trade
against each other, so only the chain of both is worth having. Used for measuring only: the
controller never hears of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cell.core.geometry import Array, Transform
from cell.core.kinematics import Arm
from cell.metrology.calibrate.board_pose import BoardPose
from cell.metrology.calibrate.hand_eye.solve import RobotNoise
from cell.metrology.motions import adjoint, inverse, nudge, small, stack

ROWS = 24  # a and d (mm), alpha and theta (rad) of six joints
REPEATABILITY = RobotNoise(0.05, 0.005)  # of an arm of the UR10e class


@dataclass(frozen=True)
class Priors:
    """How far an arm's rows may be from its controller's: standard uncertainties."""

    length_mm: float = 0.3
    twist_deg: float = 0.05
    zero_deg: float = 0.03

    @property
    def sigmas(self) -> Array:
        """In the order a, d, alpha, theta: (24,) mm and rad."""
        return np.repeat([self.length_mm, self.length_mm, np.radians(self.twist_deg),
                          np.radians(self.zero_deg)], 6)


@dataclass(frozen=True, eq=False)
class JointView:
    """One view: the joints (6,) as read, the board as seen, and which board it was.

    `base_from_reported` is the flange as the controller reports it, with whatever its factory
    calibration put into it; None where that is what the arm's rows say.
    """

    joints: tuple[float, ...]
    board: BoardPose
    board_id: str = "board"
    base_from_reported: Transform | None = None


@dataclass(frozen=True, eq=False)
class KinematicResult:
    """The arm with its residuals, and the camera on its flange.

    `residuals` (24,) are those of a, d (mm), alpha, theta (rad), `sigmas` what they are known to;
    `notable` names those that moved more than two prior standard uncertainties. `chi2` is per
    degree of freedom, before and after.
    """

    arm: Arm
    flange_from_camera: Transform
    residuals: Array
    sigmas: Array
    notable: tuple[str, ...]
    chi2_before: float
    chi2: float


def solve_kinematics(views: Sequence[JointView], arm: Arm, flange_from_camera: Transform,
                     priors: Priors | None = None,
                     noise: RobotNoise | None = None) -> KinematicResult:
    """Solve the residuals of `arm`, starting from the hand-eye transform found without them.

    Args:
        views: of one board or more; boards in several places tell more.
        arm: the published rows; the residuals are put onto the poses as reported, as measuring
            does (`correct_flange`), so that a factory calibration is not counted twice.
        flange_from_camera: the start.
        priors: how far the rows may be off.
        noise: of a reached pose once the residuals are known: repeatability alone.
    """
    prior = priors or Priors()
    fit = _Fit(views, arm, flange_from_camera, prior.sigmas, noise or REPEATABILITY)
    start = np.zeros(fit.unknowns)
    solved = least_squares(fit.residual, start, x_scale=fit.scale, loss="soft_l1", f_scale=3.0)
    jacobian = solved.jac
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    step = solved.x * fit.unit
    rows, size = step[:ROWS], 6 * len(views)
    names = [f"{kind}{joint}" for kind in ("a", "d", "alpha", "theta") for joint in range(1, 7)]
    notable = tuple(name for name, value, sigma in zip(names, rows, prior.sigmas, strict=True)
                    if abs(value) > 2.0 * sigma)
    return KinematicResult(
        with_rows(arm, rows), nudge(flange_from_camera, step[ROWS:ROWS + 6]), rows,
        (np.sqrt(np.diag(covariance)) * fit.unit)[:ROWS], notable,
        float(np.mean(fit.residual(start)[:size] ** 2)),
        float(np.sum(fit.residual(solved.x) ** 2)) / (size - 6 * (1 + len(fit.boards))))


def with_rows(arm: Arm, rows: Array) -> Arm:
    """Add residuals (24,) to an arm's rows, in the order a, d, alpha, theta."""
    a, d, alpha, theta = (tuple(float(value) for value in part) for part in rows.reshape(4, 6))
    return arm.with_residuals(a=a, d=d, alpha=alpha, theta=theta)  # type: ignore[arg-type]


class _Fit:
    """The weighted residuals of the chain: joints, camera, board; and of the priors."""

    def __init__(self, views: Sequence[JointView], arm: Arm, flange_from_camera: Transform,
                 prior: Array, noise: RobotNoise) -> None:
        self.arm, self.camera, self.prior = arm, flange_from_camera, prior
        self.joints = np.array([view.joints for view in views])
        self.seen = stack(view.board.camera_from_board for view in views)
        self.boards = sorted({view.board_id for view in views})
        self.which = np.array([self.boards.index(view.board_id) for view in views])
        self.factory = stack(view.base_from_reported or arm.forward(view.joints)
                             for view in views) @ inverse(arm.flanges(self.joints))
        chain = self._flanges(arm) @ flange_from_camera.matrix @ self.seen
        self.places = [Transform(chain[np.flatnonzero(self.which == index)[0]])
                       for index in range(len(self.boards))]
        self.roots = self._roots(views, noise)
        self.unknowns = ROWS + 6 + 6 * len(self.boards)
        poses = np.tile([1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0], 1 + len(self.boards))
        self.unit = np.concatenate([prior, poses])
        self.scale = np.ones(self.unknowns)

    def residual(self, unknown: Array) -> Array:
        """Whitened misses of all views, then the priors; unknowns in units of `unit`."""
        step = unknown * self.unit
        arm, camera = with_rows(self.arm, step[:ROWS]), nudge(self.camera, step[ROWS:ROWS + 6])
        nudges = step[ROWS + 6:].reshape(-1, 6)
        places = stack(map(nudge, self.places, nudges))[self.which]
        misses = small(inverse(places) @ self._flanges(arm) @ camera.matrix @ self.seen)
        white = np.linalg.solve(self.roots, misses[..., None])
        return np.concatenate([white.ravel(), unknown[:ROWS]])

    def _flanges(self, arm: Arm) -> Array:
        """The poses (n, 4, 4) as reported, put right by what `arm` differs from the published."""
        return np.asarray(self.factory @ arm.flanges(self.joints))

    def _roots(self, views: Sequence[JointView], noise: RobotNoise) -> Array:
        flange_from_board = self.camera.matrix @ self.seen
        robot = adjoint(inverse(flange_from_board))
        spread = np.einsum("nij,j,nkj->nik", robot, noise.variances, robot)
        seen = np.array([view.board.covariance for view in views])
        return np.asarray(np.linalg.cholesky(spread + seen), dtype=np.float64)
