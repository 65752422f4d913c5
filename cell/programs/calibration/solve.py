"""From a session's pictures to camera, light plane and hand-eye: three results, one set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cell.core.documents.calibration_session import Precondition
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Array
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.calibrate.board_blur import solve_lens_blur
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.camera import CameraResult, solve_camera
from cell.metrology.calibrate.gates import Checked, GateSet, Ruling, check_gates, worst
from cell.metrology.calibrate.hand_eye.calibration import HandEyeAnswer, calibrate_hand_eye
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.light_plane import LightPlaneResult, StripeOnBoard, solve_light_plane
from cell.metrology.calibrate.progress import camera_figures, plane_figures
from cell.metrology.calibrate.sphere import SphereResult
from cell.metrology.motions import stack
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.kinematics import KinematicsFound, find_kinematics
from cell.programs.calibration.recorded import read_gates
from cell.programs.calibration.seen import SeenView, see_again
from cell.programs.calibration.session import Session
from cell.programs.calibration.sphere import check_sphere, see_sphere
from cell.programs.calibration.stillness import mean_plane, measure_misses

STEPS = ("camera", "light plane", "laser path", "sphere", "last set")  # hand-eye says its own


@dataclass(frozen=True, eq=False)
class Solution:
    """All that a session gave; None for what was not asked for and stays as in the active set.

    `gates` are by step. `camera` is the one that light plane and hand-eye were solved with.
    `preconditions` are those that were not met, and accepted.
    """

    views: tuple[SeenView, ...]
    camera: CameraModel
    camera_result: CameraResult | None = None
    light_plane: LightPlaneResult | None = None
    hand_eye: HandEyeAnswer | None = None
    kinematics: KinematicsFound | None = None
    sphere: SphereResult | None = None
    preconditions: tuple[Precondition, ...] = ()
    gates: dict[str, tuple[Checked, ...]] = field(default_factory=dict)

    @property
    def verdict(self) -> Ruling:
        """The worst verdict over all steps, and over what was there before."""
        return worst([self.found, "warn"] if self.preconditions else [self.found])

    @property
    def found(self) -> Ruling:
        """The worst verdict over all steps."""
        findings = () if self.hand_eye is None else self.hand_eye.findings
        return worst([*(gate.verdict for gates in self.gates.values() for gate in gates),
                      *(finding.verdict for finding in findings)])

    @property
    def reasons(self) -> tuple[str, ...]:
        """What speaks against it, step by step."""
        camera_and_plane = [f"{step}: {gate}" for step in STEPS
                            for gate in self.gates.get(step, ()) if gate.verdict != "pass"]
        hand_eye = () if self.hand_eye is None else self.hand_eye.reasons
        return (*map(str, self.preconditions), *camera_and_plane, *hand_eye)


def solve_session(session: Session, belief: Belief) -> Solution:
    """Solve what the session was begun for, from its pictures on the disk.

    Raises:
        DocumentError: too few views to solve anything from.
    """
    gates = read_gates().level(session.header.plan.gates)
    views = see_views(session, belief)
    try:
        return _solve(views, session, belief, gates)
    except UnmeasurableError as error:
        raise DocumentError(f"{error.detail}", source=str(session.folder)) from None


def see_views(session: Session, belief: Belief) -> tuple[SeenView, ...]:
    """Detect board and stripe in every usable view of a session."""
    return tuple(see_again(view, session, belief) for view in session.board_views)


def _solve(seen: tuple[SeenView, ...], session: Session, belief: Belief,
           gates: GateSet) -> Solution:
    what = session.header.what
    views = tuple(view for view in seen if view.record.place == 0)
    fitted = [view for view in views if view.record.purpose == "fit"]
    checks, camera_result, plane, answer = dict[str, tuple[Checked, ...]](), None, None, None
    camera = belief.sensor.camera
    if what in ("camera", "all"):
        camera_result = _camera(fitted, belief.sensor)
        camera = camera_result.camera
        checks["camera"] = check_gates(camera_figures(camera_result), gates.camera)
    if what in ("light-plane", "all"):
        plane = _plane(fitted, camera)
        checks["light plane"] = check_gates(plane_figures(plane), gates.light_plane)
    if what in ("hand-eye", "all"):
        answer = _hand_eye(views, camera, gates)
        checks["hand-eye"] = answer.gates
    found = (find_kinematics(seen, camera, answer, belief)
             if session.header.plan.kinematics and answer else None)
    solution = Solution(views, camera, camera_result, plane, answer, found, gates=checks,
                        preconditions=session.header.warnings)
    missed = laser_path_rms(solution, belief)
    if not np.isnan(missed):
        checks["laser path"] = check_gates({"laser_path_mm": missed}, gates.hand_eye)
    return _with_sphere(solution, session, belief, gates)


def _with_sphere(solution: Solution, session: Session, belief: Belief,
                 gates: GateSet) -> Solution:
    """Check what was solved on the sphere, where the session has one."""
    sphere = session.header.sphere
    if sphere is None:
        return solution
    plane = solution.light_plane.plane if solution.light_plane else belief.sensor.light_plane
    size = belief.sensor.camera.image_size
    looks = [see_sphere(session.read_image(view.stripe, size), view.pose, view.joints, sphere,
                        belief)
             for view in session.views if view.status == "ok" and view.purpose == "sphere"]
    check = check_sphere(looks, sphere, SensorModel(solution.camera, plane), chain_of(
        solution, belief), gates.sphere)
    return replace(solution, sphere=check.result,
                   gates=solution.gates | {"sphere": check.gates})


def _camera(views: Sequence[SeenView], believed: SensorModel) -> CameraResult:
    """Solve the camera, and how soft it draws a sharp edge at the working distance."""
    result = solve_camera([view.board for view in views], believed.camera.image_size,
                          believed.camera)
    blur = solve_lens_blur([view.edges for view in views], result.camera_from_board,
                           believed.working_distance)
    return replace(result, blur=blur,
                   camera=replace(result.camera, blur=None if blur is None else blur.value))


def _plane(views: Sequence[SeenView], camera: CameraModel) -> LightPlaneResult:
    seen = [view for view in views if view.stripe is not None]
    boards = locate_boards([view.board for view in seen], camera) if seen else []
    stripes = [StripeOnBoard(view.stripe, board.camera_from_board)
               for view, board in zip(seen, boards, strict=True) if view.stripe is not None]
    return solve_light_plane(stripes, camera)


def _hand_eye(views: Sequence[SeenView], camera: CameraModel, gates: GateSet) -> HandEyeAnswer:
    session = HandEyeSession.seen(
        stack(view.record.pose for view in views), tuple(view.board for view in views), camera,
        "flange", stack(view.record.pose_after for view in views))
    apart = [view.record.number for view in views if view.record.purpose == "hold_out"]
    numbered = session.numbered(tuple(view.record.number for view in views))
    return calibrate_hand_eye(numbered, gates, apart)


def laser_path_rms(solution: Solution, belief: Belief) -> float:
    """Measure the board through the laser, in views that nothing was fitted to: mm off it, rms.

    The stripe goes the way of every measurement: light plane, camera, flange, base; the board is
    where the views of the fit have it. Not a number where there is no such view.
    """
    answer = solution.hand_eye
    if answer is None or answer.held_out is None:
        return float("nan")
    plane = solution.light_plane.plane if solution.light_plane else belief.sensor.light_plane
    chain, views = chain_of(solution, belief), solution.views
    board = mean_plane([view for view in views if view.record.number in answer.used],
                       solution.camera, chain)
    heights = [
        board.distance(chain.base_from_camera(view.record.pose, view.record.joints)
                       @ plane.meet(solution.camera.rays(view.stripe)))
        for view in views if view.record.number in answer.apart and view.stripe is not None]
    return float(np.sqrt(np.mean(np.concatenate(heights) ** 2))) if heights else float("nan")


def chain_of(solution: Solution, belief: Belief) -> Chain:
    """Say how a set of this solution carries a point to the base; what was not solved stays."""
    answer = solution.hand_eye
    if answer is None or answer.held_out is None:
        return belief.chain
    if solution.kinematics is not None and solution.kinematics.useful:
        return Chain(solution.kinematics.result.flange_from_camera, solution.kinematics.document)
    return Chain(answer.held_out.result.carrier_from_camera)


def before_and_after(solution: Solution, belief: Belief) -> tuple[Array, Array] | None:
    """Measure how far (n,) mm each view misses the mean board, by the set before and by what was
    solved now; None without a hand-eye.
    """
    if solution.hand_eye is None or not solution.views:
        return None
    return (measure_misses(solution.views, belief.sensor.camera, belief.chain),
            measure_misses(solution.views, solution.camera, chain_of(solution, belief)))
