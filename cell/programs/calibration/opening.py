"""How a session opens: preconditions, start views, a plan that is agreed to; or a resumed one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from cell.core.documents.base import as_six
from cell.core.documents.calibration import RobotRecord
from cell.core.documents.calibration_session import (
    CalibrationPlan,
    PlacedBoard,
    Precondition,
    SessionHeader,
    Target,
    ViewRecord,
    What,
)
from cell.core.documents.papers import check_identity
from cell.core.documents.targets import BoardDocument, SphereDocument
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Transform
from cell.core.ports import Operator, RobotIdentity
from cell.programs.calibration.belief import Belief, design_of
from cell.programs.calibration.capture import describe, drive, shoot
from cell.programs.calibration.gathering import SAY_KEYS
from cell.programs.calibration.poses import free_path, plan_poses, plan_sphere, plan_start
from cell.programs.calibration.preconditions import (
    accept_preconditions,
    check_preconditions,
    show_preconditions,
)
from cell.programs.calibration.seen import SeenView, see_again, see_view
from cell.programs.calibration.session import Session, latest_session
from cell.programs.calibration.shown import Shown
from cell.programs.calibration.sphere import choose_sphere
from cell.programs.calibration.start_view import StartView
from cell.programs.calibration.stillness import measure_shift
from cell.programs.station import Station

SAME_PLACE = 0.1  # mm by which an old view may differ before a session is gone on with
ELSEWHERE_APART = 3  # views of a further board that nothing is fitted to
PLACES_NEEDED = ("The arm's own rows (`kinematics: true`) want boards in two places or more: views "
                 "of one place hardly tell them from the camera's mount. Put a second board into "
                 "the cell and into targets.yaml.")


@dataclass(frozen=True, eq=False)
class Opening:
    """Opens a session at a station, with an operator."""

    what: What
    plan: CalibrationPlan
    belief: Belief
    station: Station
    operator: Operator
    shown: Shown

    def begin(self) -> Session:
        """Begin a session: nothing moves that was not agreed to.

        Raises:
            DeviceError: a device failed.
            DocumentError: something speaks against it, or the operator does.
        """
        boards = self._choose_boards()
        conditions, accepted = self._check_preconditions(boards)
        placed = [self._start_view(board) for board in boards]
        self.operator.tell("planning the views ...")
        targets, predicted = self._plan_views(placed)
        sphere = None if self.what == "camera" else choose_sphere(self.plan, self.belief,
                                                                  self.operator)
        targets += self._plan_sphere(sphere, placed[0])
        header = self._header(placed, targets, sphere).model_copy(update={
            "preconditions": conditions, "accepted": accepted})
        self.shown.plan(header)
        self._agree(f"{_counted(targets)} are planned, all moves checked{_worth(predicted)}. Drive "
                    f"them at half speed? (Keys then: {SAY_KEYS}.)")
        name = f"{_now('%Y-%m-%dT%H%M%SZ')}-{self.what}"
        return Session.begin(self.belief.folder / "sessions" / name, header)

    def resume(self) -> Session:
        """Go on with the newest session, once an old view is found to be as it was.

        Raises:
            DeviceError: a device failed.
            DocumentError: there is none, or it cannot be gone on with.
        """
        session = Session.read(latest_session(self.belief.folder, self.what))
        header = session.header
        if header.base_set != self.belief.set_id:
            raise DocumentError(f"the active set was {header.base_set} when this session began and "
                                f"is {self.belief.set_id} now: begin again",
                                source=str(session.folder))
        check_identity(header.robot, self.station.identity, str(session.folder))
        used = session.board_views
        self.operator.tell(f"going on with {session.folder.name}: {len(used)} views are there")
        self._agree_to_go_on(session, used)
        if used:
            self._check_old_view(used[-1], session)
        return session

    def _agree_to_go_on(self, session: Session, used: Sequence[ViewRecord]) -> None:
        left = len(session.header.targets) - len(session.views)
        first = "to the last of them, to see that nothing has moved, then " if used else ""
        self._agree(f"The arm will drive {first}through the {left} views that are left, at half "
                    f"speed, and home. Is the way clear? (Keys then: {SAY_KEYS}.)")

    def _choose_boards(self) -> list[BoardDocument]:
        """The board to calibrate with; and the others, where the arm's own rows are wanted."""
        first = self.belief.board(self.plan.board)
        others = [board for board in self.belief.targets.boards if board.id != first.id]
        if self.what not in ("hand-eye", "all"):
            return [first]
        if not others:
            if self.plan.kinematics:
                self.operator.tell(PLACES_NEEDED)
            return [first]
        if self.plan.kinematics or self.operator.choose(
                f"targets.yaml has boards in {1 + len(others)} places. With views of all of them "
                "the arm's own rows are found as well, which makes measuring truer. Look at one "
                f"board ({first.id}) or at all?", ("one", "all")) == "all":
            return [first, *others]
        return [first]

    def _check_preconditions(self, boards: Sequence[BoardDocument]
                             ) -> tuple[tuple[Precondition, ...], str]:
        lines = check_preconditions(self.what, self.belief, boards, self.station.identity,
                                    self.station.robot.state().temperatures,
                                    datetime.now(UTC).date())
        self.operator.tell(f"controller software {self.station.identity.software}, active set "
                           f"{self.belief.set_id}")
        show_preconditions(lines, self.operator)
        for board in boards:
            self.operator.tell(f"board {board.id}: {board.squares[0]} x {board.squares[1]} squares "
                               f"of {board.square_mm:g} mm; {board.certificate or '-'}")
        accepted = accept_preconditions(lines, self.plan.reason, self.operator)
        warm = ", and is the arm warm (half an hour of motion)" \
            if any(line.verdict == "asked" for line in lines) else ""
        self._agree(f"Is this the robot, the board and the mounting{warm}?")
        return lines, accepted

    def _start_view(self, board: BoardDocument) -> PlacedBoard:
        start = plan_start(self.belief, design_of(board), board.rough_place)
        self._agree(f"The arm will drive to the start view, in front of the board {board.id}. Is "
                    "the way clear?")
        here = self.station.robot.state().joints
        drive(self.station, free_path(self.belief, here, start, self.belief.home))
        return StartView(board, self.belief, self.plan, self.station, self.operator,
                         self.shown).find()

    def _plan_views(self, placed: Sequence[PlacedBoard]) -> tuple[list[Target], float]:
        """Plan the views of all boards; the prediction is for those of the first."""
        elsewhere = self.plan.model_copy(update={"views": self.plan.views_elsewhere,
                                                 "hold_out": ELSEWHERE_APART})
        targets, predicted = list[Target](), float("nan")
        for place, one in enumerate(placed):
            planned = plan_poses(self.belief, elsewhere if place else self.plan,
                                 design_of(one.board), place_of(one), one.start)
            targets += [Target(purpose=purpose, joints=as_six(joints), place=place)
                        for purpose, joints in planned.targets]
            predicted = predicted if place else planned.predicted
        return targets, predicted if self.what in ("hand-eye", "all") else float("nan")

    def _plan_sphere(self, sphere: SphereDocument | None, first: PlacedBoard) -> list[Target]:
        if sphere is None:
            return []
        over = plan_sphere(self.belief, sphere, first.start, self.plan.sphere_views)
        return [Target(purpose="sphere", joints=as_six(joints)) for joints in over]

    def _header(self, placed: Sequence[PlacedBoard], targets: Sequence[Target],
                sphere: SphereDocument | None) -> SessionHeader:
        plan = self.plan.model_copy(update={"kinematics": self.plan.kinematics or len(placed) > 1})
        return SessionHeader(
            cell=self.belief.folder.name, what=self.what, begun=_now("%Y-%m-%dT%H:%M:%SZ"),
            base_set=self.belief.set_id, robot=_robot(self.station.identity),
            sensor_serial=self.belief.sensor_document.serial, boards=tuple(placed), sphere=sphere,
            plan=plan, targets=tuple(targets))

    def _check_old_view(self, view: ViewRecord, session: Session) -> None:
        """Look once more from an old place: the board must still stand where it stood."""
        boards = session.header.boards
        here = self.station.robot.state().joints
        drive(self.station, free_path(self.belief, here, view.joints, self.belief.home,
                                      boards[view.place].start))
        shift = measure_shift(see_again(view, session, self.belief), self._look(view, session),
                              self.belief.sensor.camera, self.belief.chain)
        if shift > SAME_PLACE:
            raise DocumentError(f"the board stands {shift:.2f} mm from where it stood: begin again",
                                source=str(session.folder))

    def _look(self, view: ViewRecord, session: Session) -> SeenView:
        shots = shoot(self.station)
        try:
            return see_view(describe(session, view.number, shots), shots.ring.image,
                            shots.stripe.image, self.belief,
                            session.header.boards[view.place].board)
        except UnmeasurableError as error:
            raise DocumentError(f"the board is not where it was: {error.detail}; begin again",
                                source=str(session.folder)) from None

    def _agree(self, question: str) -> None:
        if not self.operator.confirm(question):
            raise DocumentError("stopped by the operator")


def place_of(one: PlacedBoard) -> Transform:
    """Where a board of a session stands: base_from_board."""
    return Transform(np.array(one.base_from_board))


def _counted(targets: Sequence[Target]) -> str:
    """Say how many views are planned of what."""
    def words() -> Iterator[str]:
        for place in sorted({target.place for target in targets}):
            here = [t.purpose for t in targets if t.place == place and t.purpose != "sphere"]
            where = f" of board {place + 1}" if place else ""
            yield f"{here.count('fit')} views{where} and {here.count('hold_out')} kept apart"
        if over := sum(target.purpose == "sphere" for target in targets):
            yield f"{over} of the sphere"
    return ", ".join(words())


def _worth(predicted: float) -> str:
    return "" if np.isnan(predicted) else f"; predicted uncertainty {predicted:.3f} mm"


def _robot(identity: RobotIdentity) -> RobotRecord:
    return RobotRecord(model=identity.model, serial=identity.serial,
                       kinematics_checksum=identity.kinematics_checksum,
                       payload_kg=identity.payload_kg, tcp_offset=as_six(identity.tcp_offset))


def _now(form: str) -> str:
    return datetime.now(UTC).strftime(form)
