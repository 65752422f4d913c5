"""The wizard: preconditions, start view, plan, capture, result, set. An operator is asked; nothing
moves that was not shown and agreed to.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np

from cell.archive.activation import activate
from cell.core.documents.calibration import RobotRecord
from cell.core.documents.calibration_session import CalibrationPlan, SessionHeader, ViewRecord
from cell.core.documents.papers import check_identity
from cell.core.documents.targets import BoardDocument
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Transform
from cell.core.ports import Joints, Operator, RobotIdentity
from cell.metrology.board_pose import locate_boards
from cell.metrology.detect_board import SeenBoard, detect_board
from cell.programs.calibration.belief import Belief, design_of, read_belief
from cell.programs.calibration.capture import as_rows, as_six, drive, shoot
from cell.programs.calibration.gathering import Gathering
from cell.programs.calibration.make_set import Signature, make_set
from cell.programs.calibration.poses import free_path, plan_poses, plan_sphere, plan_start
from cell.programs.calibration.session import Session, latest_session
from cell.programs.calibration.solve import Solution, board_shift, solve_session
from cell.programs.calibration.sphere import choose_sphere
from cell.programs.station import Station, open_station

What = Literal["camera", "light-plane", "hand-eye", "all"]
SAME_PLACE = 0.1     # mm by which an old view may differ before a session is gone on with
STARTS = 5           # looks at the start view before the wizard gives up


@dataclass(frozen=True)
class Request:
    """What the wizard was asked for."""

    what: What
    cell: str
    plan: CalibrationPlan = field(default_factory=CalibrationPlan)
    calibration: Path = Path("calibration")
    speed: float = 1.0
    resume: bool = False


@dataclass(frozen=True, eq=False)
class Finished:
    """What came of it: the set is None where it was refused, not wanted, or the camera alone."""

    session: Path
    solution: Solution
    set_id: str | None
    active: bool


def run_wizard(request: Request, operator: Operator) -> Finished:
    """Calibrate a cell.

    Raises:
        DocumentError: a paper is wrong, or the operator did not agree; nothing is activated.
        DeviceError: a device failed; what was captured is on the disk, `resume` goes on.
    """
    belief = read_belief(request.calibration, request.cell)
    with open_station(belief.station, belief.folder, request.speed) as station:
        session = (_resume(request.what, belief, station, operator) if request.resume
                   else _begin(request, belief, station, operator))
        Gathering(session, belief, station, operator).gather()
        drive(station, _way_home(belief, station, session))
    return conclude(session, belief, operator)


def conclude(session: Session, belief: Belief, operator: Operator) -> Finished:
    """Solve what was captured, say what came of it, and make and activate the set."""
    operator.tell("solving ...")
    solution = solve_session(session, belief)
    show(solution, operator)
    reason = _accepted(solution, session.header.plan, operator)
    session.conclude(f"{solution.verdict}{'' if reason is None else ', accepted'}")
    if reason is None or session.header.what == "camera":
        return Finished(session.folder, solution, None, active=False)
    signature = Signature(session.header.plan.operator, _now("%Y-%m-%dT%H%MZ"), reason)
    set_id = make_set(session, solution, belief, signature)
    operator.tell(f"set {set_id} made: {belief.folder / 'sets' / set_id / 'report.html'}")
    if not (session.header.plan.activate and operator.confirm(f"Activate {set_id}?")):
        return Finished(session.folder, solution, set_id, active=False)
    activate(belief.folder, set_id, by=signature.by, at=_now("%Y-%m-%dT%H:%M:%SZ"), reason=reason)
    return Finished(session.folder, solution, set_id, active=True)


def show(solution: Solution, operator: Operator) -> None:
    """Say every figure with its limit and verdict, then what was found."""
    for step, gates in solution.gates.items():
        operator.tell(f"{step}:")
        for gate in gates:
            operator.tell(f"  {gate.verdict:6} {gate.meaning}: {gate.value:.4g}, wanted "
                          f"{gate.limit}")
    for reason in solution.reasons:
        operator.tell(f"- {reason}")
    if solution.hand_eye is not None and solution.hand_eye.limited_by:
        operator.tell(solution.hand_eye.limited_by)
    if solution.kinematics is not None:
        found = solution.kinematics
        operator.tell(f"kinematics: views kept apart {found.apart_without:.3f} mm without, "
                      f"{found.apart_with:.3f} mm with the arm's own rows: "
                      f"{'kept' if found.useful else 'not kept'}")
    operator.tell(f"verdict: {solution.verdict}")


def _begin(request: Request, belief: Belief, station: Station, operator: Operator) -> Session:
    board = belief.board(request.plan.board)
    _check_preconditions(belief, board, station, operator)
    start = plan_start(belief, design_of(board), board.rough_place)
    _agree(operator, "The arm will drive to the start view, in front of the board. Is the way "
                     "clear?")
    drive(station, free_path(belief, station.robot.state().joints, start, start))
    place, start = _start_view(belief, board, station, operator)
    operator.tell("planning the views ...")
    planned = plan_poses(belief, request.plan, design_of(board), place, start)
    sphere = None if request.what == "camera" else choose_sphere(request.plan, belief, operator)
    over = plan_sphere(belief, sphere, start, request.plan.sphere_views) if sphere else ()
    _agree(operator, f"{len(planned.targets)} views are planned and {len(over)} of the sphere, all "
                     f"moves checked; predicted uncertainty {planned.predicted:.3f} mm. Drive them "
                     "at half speed?")
    header = SessionHeader(
        cell=belief.folder.name, what=request.what, begun=_now("%Y-%m-%dT%H:%M:%SZ"),
        base_set=belief.set_id, robot=_robot(station.identity),
        sensor_serial=belief.sensor_document.serial, board=board, sphere=sphere,
        plan=request.plan,
        base_from_board=as_rows(place),
        targets=(("start", as_six(start)),
                 *((purpose, as_six(joints)) for purpose, joints in planned.targets),
                 *(("sphere", as_six(joints)) for joints in over)))
    name = f"{_now('%Y-%m-%dT%H%M%SZ')}-{request.what}"
    return Session.begin(belief.folder / "sessions" / name, header)


def _resume(what: What, belief: Belief, station: Station, operator: Operator) -> Session:
    session = Session.read(latest_session(belief.folder, what))
    header = session.header
    if (header.base_set, header.robot.serial) != (belief.set_id, station.identity.serial):
        raise DocumentError("robot or active set have changed since this session began: begin "
                            "again", source=str(session.folder))
    check_identity(header.robot, station.identity, str(session.folder))
    used = [view for view in session.views
            if view.status == "ok" and view.purpose != "sphere"]
    operator.tell(f"going on with {session.folder.name}: {len(used)} views are there")
    if used:
        _check_old_view(used[-1], session, belief, station)
    return session


def _check_old_view(view: ViewRecord, session: Session, belief: Belief, station: Station) -> None:
    """Look once more from an old place: the board must still stand where it stood."""
    start = session.header.targets[0][1]
    here = station.robot.state().joints
    drive(station, free_path(belief, here, view.joints, start))
    gathering = Gathering(session, belief, station)
    before = gathering.see_again(view)
    again = gathering.look(view.number, view.purpose)
    shift = board_shift(before, again, belief)
    if shift > SAME_PLACE:
        raise DocumentError(f"the board stands {shift:.2f} mm from where it stood: begin again",
                            source=str(session.folder))


def _check_preconditions(belief: Belief, board: BoardDocument, station: Station,
                         operator: Operator) -> None:
    """Show on one screen what residuals cannot show, and have it confirmed."""
    identity = station.identity
    check_identity(belief.hand_eye.robot, identity, f"set {belief.set_id}")
    tcp = ", ".join(f"{value:g}" for value in identity.tcp_offset)
    for line in (
            f"robot      {identity.model} {identity.serial}, software {identity.software}",
            f"kinematics {identity.kinematics_checksum}",
            f"TCP offset {tcp}   payload {identity.payload_kg:g} kg",
            f"sensor     {belief.sensor_document.serial}   active set {belief.set_id}",
            f"board      {board.id}: {board.squares[0]} x {board.squares[1]} squares of "
            f"{board.square_mm:g} mm; {board.certificate or 'NO CERTIFICATE'}, valid until "
            f"{board.certified_until or 'unknown'}"):
        operator.tell(line)
    expired = board.certified_until is None or board.certified_until < _now("%Y-%m-%d")
    if expired:
        operator.tell("The board has no valid certificate: a board 0.2 % too large puts the "
                      "camera half a millimetre off, and no residual shows it.")
    _agree(operator, "Is this the robot, the board and the mounting, and is the arm warm?")


def _start_view(belief: Belief, board: BoardDocument, station: Station,
                operator: Operator) -> tuple[Transform, Joints]:
    """Look until the operator is content; say where the board is and where the arm stands."""
    design = design_of(board)
    for _ in range(STARTS):
        shots = shoot(station)
        try:
            seen = detect_board(shots.ring.image, design)
        except UnmeasurableError as error:
            operator.tell(error.detail)
            _agree(operator, "Jog the arm until the board fills the view. Look again?")
            continue
        pose = locate_boards([seen.view], belief.sensor.camera)[0]
        operator.tell(live_line(seen, design.corners, pose.tilt, pose.camera_from_board))
        if operator.confirm("Does the board fill the view, sharp and well lit?"):
            place = (shots.ring.base_from_flange_before @ belief.flange_from_camera
                     @ pose.camera_from_board)
            return place, shots.ring.joints
        _agree(operator, "Jog the arm until it does. Look again?")
    raise DocumentError("no good start view", source=f"cell {belief.folder.name}")


def live_line(seen: SeenBoard, corners: int, tilt: float, camera_from_board: Transform) -> str:
    """Say what an operator wants to know while jogging."""
    cut = f"   cut off: {', '.join(seen.cut_off)}" if seen.cut_off else ""
    return (f"corners {len(seen.view.pixels)}/{corners}   sharp {seen.sharpness:.2f}   exposure "
            f"{seen.exposure}   tilt {np.degrees(tilt):.0f} deg   distance "
            f"{camera_from_board.translation[2]:.0f} mm{cut}")


def _accepted(solution: Solution, plan: CalibrationPlan, operator: Operator) -> str | None:
    """Ask why warnings are accepted; None where the set is refused."""
    if solution.verdict == "refuse":
        operator.tell("Refused: no set is made. The session is kept.")
        return None
    if solution.verdict == "pass":
        return ""
    reason = plan.reason or operator.ask("There are warnings. Why is this set acceptable? (empty: "
                                         "it is not)", "")
    return reason.strip() or None


def _way_home(belief: Belief, station: Station, session: Session) -> Sequence[Joints]:
    home = as_six([float(angle) for angle in np.radians(belief.station.home_deg)])
    return free_path(belief, station.robot.state().joints, home, session.header.targets[0][1])


def _robot(identity: RobotIdentity) -> RobotRecord:
    return RobotRecord(model=identity.model, serial=identity.serial,
                       kinematics_checksum=identity.kinematics_checksum,
                       payload_kg=identity.payload_kg, tcp_offset=as_six(identity.tcp_offset))


def _agree(operator: Operator, question: str) -> None:
    if not operator.confirm(question):
        raise DocumentError("stopped by the operator")


def _now(form: str) -> str:
    return datetime.fromtimestamp(time.time(), UTC).strftime(form)
