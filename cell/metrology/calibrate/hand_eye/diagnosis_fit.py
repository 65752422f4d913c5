"""What a hand-eye fit says of its own input: camera, board, single views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.metrology.calibrate.camera import FREE, CameraResult, solve_camera
from cell.metrology.calibrate.gates import Gate
from cell.metrology.calibrate.hand_eye.check import object_rms
from cell.metrology.calibrate.hand_eye.explanations import Explanation, find_bump
from cell.metrology.calibrate.hand_eye.finding import Finding
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeResult, RobotNoise
from cell.metrology.calibrate.hand_eye.start import solve_park

BETTER = 4.0           # F ratio of the corners' misfit: beyond chance
CERTAIN = 4.0          # standard uncertainties
NOTABLE = 0.002        # of the focal length: 0.1 degrees, or 0.5 mm at 250 mm
HARMFUL = 1.4          # by how much another camera fits better, corners or board
JUMP = 8.0             # F ratio of a moved board: beyond chance and slow drifts
HALVED = 0.5           # what a moved board must make of the misfit
NOT_NOISE = 2.0        # chi2 from which a moved board is looked for
LEAST_BUMP = 0.1       # mm


@dataclass(frozen=True, eq=False)
class CameraCheck:
    """The camera given against the one that the session's own corners ask for."""

    own: CameraResult
    better: float
    change: float
    change_sigmas: float
    pnp_rms_given: float
    object_rms_given: float
    object_rms_own: float

    @property
    def doubtful(self) -> bool:
        """Whether the given parameters do not fit these pictures, and it matters."""
        shifted = self.change > NOTABLE and self.change_sigmas > CERTAIN
        harmful = (self.object_rms_given > HARMFUL * self.object_rms_own
                   or self.pnp_rms_given > HARMFUL * self.own.rms_px)
        return self.better > BETTER and (shifted or harmful)


def check_camera(session: HandEyeSession, sound: HandEyeSession) -> CameraCheck | None:
    """Calibrate the camera from the session's own corners and compare; None where they do not tell.

    A view whose robot pose is wrong still tells of the camera: how still the board stands is judged
    by the `sound` views alone.
    """
    if session.camera is None:
        return None
    try:
        own = solve_camera(session.views, session.camera.image_size, session.camera)
        again = sound.with_camera(own.camera)
    except (UnmeasurableError, np.linalg.LinAlgError):
        return None
    variances = np.diag(own.covariance)[:4]
    if variances.min() <= 0.0:  # corners that contradict each other leave no minimum
        return None
    step = (own.camera.matrix - session.camera.matrix)[[0, 1, 0, 1], [0, 1, 2, 2]]
    return CameraCheck(own, _better(session, own),
                       float(np.abs(step).max() / session.camera.matrix[0, 0]),
                       float(np.abs(step / np.sqrt(variances)).max()),
                       session.pnp_rms_px, _still(sound), _still(again))


def judge_camera(check: CameraCheck | None, split_half: Gate) -> list[Finding]:
    """Say what speaks against the camera's parameters."""
    found: list[Finding] = []
    if check is None:
        return found
    if 100.0 * check.own.split_half > (split_half.refuse_above or np.inf):
        found.append(Finding("intrinsics", "refuse", "the intrinsics are doubtful: the focal "
                     f"length differs by {100 * check.own.split_half:.2f} % between even and odd "
                     "views. Calibrate the camera again, with tilted views over the whole image."))
    if check.doubtful:
        found.append(Finding("intrinsics", "refuse", "the intrinsics do not fit these pictures: "
                     "parameters from the same corners change the camera by "
                     f"{100 * check.change:.2f} % of the focal length ({check.change_sigmas:.0f} "
                     f"standard uncertainties); corners then miss by {check.own.rms_px:.2f} px "
                     f"instead of {check.pnp_rms_given:.2f}, and the board stands still to "
                     f"{check.object_rms_own:.3g} mm instead of {check.object_rms_given:.3g} mm."))
    return found


def judge_board(session: HandEyeSession, problem: HandEyeProblem,
                result: HandEyeResult) -> list[Finding]:
    """Say whether the board seems to have moved during the session."""
    bump, noisy = find_bump(problem, result), bool(session.views) and result.chi2 < NOT_NOISE
    if bump is None or noisy or bump.shift < LEAST_BUMP or bump.explanation.better < JUMP:
        return []
    certain = bump.explanation.chi2 < HALVED * result.chi2
    return [Finding("board_moved", "refuse" if certain else "warn",
                    "the residuals jump between view "
                    f"{session.numbers[bump.after_view]} and view "
                    f"{session.numbers[bump.before_view]}: the board seems to have moved by "
                    f"{bump.shift:.2f} mm (misfit {result.chi2:.2g}, with that "
                    f"{bump.explanation.chi2:.2g}). If so, fix it and begin again.")]


def judge_views(session: HandEyeSession, problem: HandEyeProblem,
                result: HandEyeResult) -> list[Finding]:
    """Name the views that contradict the others, and by how much."""
    return [Finding("bad_view", "warn", f"view {session.numbers[index]} disagrees by "
                    f"{_shift_of_board(problem, result, index):.2f} mm: it was left out, retake it")
            for index in result.dropped]


def judge_scale(scale: Explanation, chi2: float, gate: Gate) -> list[Finding]:
    """Say what the robot's motions make of the board's size, where they contradict the entry."""
    percent, sigma = 100.0 * float(scale.values[0]), 100.0 * float(scale.sigmas[0])
    ruling = gate.rule(abs(percent))
    explains = chi2 > NOT_NOISE and scale.chi2 < HALVED * chi2
    if abs(percent) < CERTAIN * sigma or (ruling == "pass" and not explains):
        return []
    differs = f"{abs(percent):.1f} % {'larger' if percent > 0 else 'smaller'}"
    return [Finding("board_scale", "refuse" if ruling == "refuse" else "warn",
                    f"the board is {differs} than entered (+- {sigma:.2f} %), or the robot or the "
                    "focal length is off by as much: measure the squares")]


def _better(session: HandEyeSession, own: CameraResult) -> float:
    """The F ratio of the eight camera parameters that the session's own corners would choose."""
    given = sum(float(np.sum(board.residuals ** 2)) for board in session.boards)
    left = sum(float(np.sum(residual ** 2)) for residual in own.residuals)
    freedom = sum(2 * len(view.pixels) - 6 for view in session.views) - FREE
    return (given - left) / FREE / max(left / max(1, freedom), 1e-12)


def _still(session: HandEyeSession) -> float:
    problem = session.problem(RobotNoise())
    camera = solve_park(problem.reference_from_carrier, problem.camera_from_board)
    return object_rms(problem, camera)


def _shift_of_board(problem: HandEyeProblem, result: HandEyeResult, index: int) -> float:
    turn, shift = np.split(result.shifts[index], 2)
    middle = problem.views[index].board.points_in_board.mean(axis=0)
    return float(np.linalg.norm(shift + np.cross(turn, middle)))
