"""The wizard: preconditions, start view, plan, capture, result, set. An operator is asked; nothing
moves that was not shown and agreed to.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from cell.archive.activation import activate
from cell.archive.files import check_writable
from cell.core.documents.calibration_session import CalibrationPlan, SessionHeader, What
from cell.core.ports import Operator
from cell.programs.calibration.belief import Belief, read_belief
from cell.programs.calibration.capture import drive
from cell.programs.calibration.gathering import Gathering
from cell.programs.calibration.last_set import with_last_set
from cell.programs.calibration.make_set import Signature, make_set, page_of
from cell.programs.calibration.opening import Opening
from cell.programs.calibration.poses import free_path
from cell.programs.calibration.session import Session
from cell.programs.calibration.shown import Shown
from cell.programs.calibration.solve import Solution, solve_session
from cell.programs.station import open_station
from cell.recording.live import LiveView


@dataclass(frozen=True)
class Request:
    """What the wizard was asked for."""

    what: What
    cell: str
    plan: CalibrationPlan = field(default_factory=CalibrationPlan)
    calibration: Path = Path("calibration")
    speed: float = 1.0
    resume: bool = False
    live: bool = False


@dataclass(frozen=True, eq=False)
class Finished:
    """What came of it: there is no set where it was not accepted, and none of the camera alone."""

    session: Path
    solution: Solution
    accepted: bool
    set_id: str | None = None
    active: bool = False


def run_wizard(request: Request, operator: Operator) -> Finished:
    """Calibrate a cell.

    Raises:
        DocumentError: a paper is wrong, or the operator did not agree; nothing is activated.
        DeviceError: a device failed; what was captured is on the disk, `resume` goes on.
    """
    belief = read_belief(request.calibration, request.cell)
    check_writable(belief.folder / "sessions", "sessions")
    with LiveView() if request.live else nullcontext() as live:
        shown = Shown(belief, request.what, f"calibration-{_now('%Y-%m-%dT%H%M%SZ')}", live)
        session = _capture(request, belief, operator, shown)
        return conclude(session, belief, operator, shown)


def _capture(request: Request, belief: Belief, operator: Operator, shown: Shown) -> Session:
    """Open a session, capture what it lacks, and bring the arm home."""
    with open_station(belief.station, belief.folder, request.speed) as station:
        opening = Opening(request.what, request.plan, belief, station, operator, shown)
        session = opening.resume() if request.resume else opening.begin()
        Gathering(session, belief, station, operator, shown).gather()
        here = station.robot.state().joints
        drive(station, free_path(belief, here, belief.home,
                                 *(one.start for one in session.header.boards)))
    return session


def conclude(session: Session, belief: Belief, operator: Operator, shown: Shown) -> Finished:
    """Solve what was captured, say what came of it, and make and activate the set."""
    operator.tell("solving ...")
    shown.step("solving")
    solution = with_last_set(solve_session(session, belief), belief, session.header.plan.gates)
    show(solution, operator)
    signature = Signature(session.header.plan.operator, _now("%Y-%m-%dT%H%MZ"))
    shown.concluded(page_of(solution, session.header, belief, signature))
    reason = _accepted(solution, session.header, operator)
    session.conclude(f"{solution.verdict}{'' if reason is None else ', accepted'}")
    finished = Finished(session.folder, solution, accepted=reason is not None)
    if reason is None or session.header.what == "camera":
        return finished
    set_id = make_set(session, solution, belief, replace(signature, reason=reason))
    operator.tell(f"set {set_id} made: {belief.folder / 'sets' / set_id / 'report.html'}")
    if not (session.header.plan.activate and operator.confirm(f"Activate {set_id}?")):
        return replace(finished, set_id=set_id)
    activate(belief.folder, set_id, by=signature.by, at=_now("%Y-%m-%dT%H:%M:%SZ"), reason=reason)
    return replace(finished, set_id=set_id, active=True)


def show(solution: Solution, operator: Operator) -> None:
    """Say every figure with its limit and verdict, then what was found."""
    for step, gates in solution.gates.items():
        operator.tell(f"{step}:")
        for gate in gates:
            operator.tell(f"  {gate.verdict:6} {gate.meaning}: {gate.value:.4g}, wanted "
                          f"{gate.limit}")
    if solution.camera_result is not None:
        operator.tell(solution.camera_result.softness)
    for reason in solution.reasons:
        operator.tell(f"- {reason}")
    if solution.hand_eye is not None and solution.hand_eye.limited_by:
        operator.tell(solution.hand_eye.limited_by)
    if solution.kinematics is not None:
        operator.tell(str(solution.kinematics))
    operator.tell(f"verdict: {solution.verdict}")


def _accepted(solution: Solution, header: SessionHeader, operator: Operator) -> str | None:
    """Ask why warnings are accepted; None where the set is refused."""
    if solution.verdict == "refuse":
        operator.tell("Refused: no set is made. The session is kept.")
        return None
    if header.what == "camera":
        operator.tell("The camera alone makes no set: `cell calibrate all` does.")
    if solution.found == "pass" or header.what == "camera":
        return header.accepted
    reason = header.plan.reason or operator.ask("There are warnings. Why is this set acceptable? "
                                                "(empty: it is not)", "")
    if not reason.strip():
        operator.tell("Not accepted: no set is made. The session is kept.")
        return None
    return _merged(header.accepted, reason.strip())


def _merged(*reasons: str) -> str:
    return "; ".join(dict.fromkeys(reason for reason in reasons if reason))


def _now(form: str) -> str:
    return datetime.now(UTC).strftime(form)
