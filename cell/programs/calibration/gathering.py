"""The capture loop: one line a view, retake, skip, pause or quit, and an early stop at the goal."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cell.core.documents.calibration_session import Purpose, ViewRecord
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Transform
from cell.core.ports import Operator
from cell.metrology.board_pose import locate_boards
from cell.metrology.hand_eye import HandEyeProblem, HandEyeView
from cell.metrology.pose_planning import predict_point_sigma
from cell.programs.calibration.belief import Belief, design_of
from cell.programs.calibration.capture import Shots, as_rows, as_six, drive, record, shoot
from cell.programs.calibration.poses import free_path
from cell.programs.calibration.seen import SeenView, see_view
from cell.programs.calibration.session import Session
from cell.programs.calibration.sphere import see_sphere
from cell.programs.station import Station

TRIES = 3
ENOUGH = 12  # views before an early stop
FEWEST_TO_PREDICT = 3


@dataclass(eq=False)
class Gathering:
    """Captures what a session still lacks."""

    session: Session
    belief: Belief
    station: Station
    operator: Operator | None = None
    known: list[HandEyeView] = field(default_factory=list)

    def gather(self) -> None:
        """Capture all planned views that are not on the disk yet.

        Raises:
            DeviceError: a device failed; the views until then are on the disk.
            DocumentError: the operator quit, or the disk refuses.
        """
        done = {view.number: view for view in self.session.views}
        for view in done.values():
            if view.status == "ok" and view.purpose == "fit":
                self._know(self.see_again(view))
        for number, (purpose, joints) in enumerate(self.session.header.targets):
            if purpose == "start" or number in done or self._skips(purpose):
                continue
            self._go(joints)
            self._capture(number, purpose)

    def look(self, number: int, purpose: Purpose) -> SeenView:
        """Take one view from where the arm stands, without keeping it.

        Raises:
            UnmeasurableError: no board in it.
        """
        shots = shoot(self.station)
        return self._see(shots, number, purpose)

    def see_again(self, view: ViewRecord) -> SeenView:
        """Detect again in the pictures of a view that is on the disk."""
        size = self.belief.sensor.camera.image_size
        return see_view(view, self.session.read_image(view.ring, size),
                        self.session.read_image(view.stripe, size), self.belief,
                        design_of(self.session.header.board))

    def _capture(self, number: int, purpose: Purpose) -> None:
        shots, status = shoot(self.station), ""
        for attempt in range(TRIES):
            shots = shoot(self.station) if attempt else shots
            if shots.moved(self.station):
                status = "the robot moved"
                continue
            try:
                self._keep(shots, number, purpose)
            except UnmeasurableError as error:
                status = error.detail
                if not self._again(number, status):
                    break
            else:
                return
        record(self.session, number, purpose, shots, 0, status)
        self._tell(f"{number:02}/{self._last} skipped: {status}")

    def _keep(self, shots: Shots, number: int, purpose: Purpose) -> None:
        if purpose == "sphere":
            self._keep_sphere(shots, number)
        else:
            self._keep_board(shots, number, purpose)

    def _keep_sphere(self, shots: Shots, number: int) -> None:
        assert self.session.header.sphere is not None
        look = see_sphere(shots.stripe.image, shots.ring.base_from_flange_before,
                          self.session.header.sphere, self.belief)
        record(self.session, number, "sphere", shots, 0, "ok")
        self._tell(f"{number:02}/{self._last} ok sphere   {len(look.pixels)} points of the stripe")

    def _keep_board(self, shots: Shots, number: int, purpose: Purpose) -> None:
        view = self._see(shots, number, purpose)
        record(self.session, number, purpose, shots, len(view.board.pixels), "ok")
        before = after = self.predicted()
        if purpose == "fit":
            self._know(view)
            after = self.predicted()
        stripe = "" if view.stripe is not None else "   no stripe"
        self._tell(f"{number:02}/{self._last} ok {purpose:8} {len(view.board.pixels)} corners"
                   f"{stripe} | predicted uncertainty {_figure(before)} -> "
                   f"{_figure(after)} mm (goal {self.session.header.plan.goal_mm:.3f})")

    def _see(self, shots: Shots, number: int, purpose: Purpose) -> SeenView:
        view = ViewRecord(number=number, purpose=purpose, joints=as_six(shots.ring.joints),
                          base_from_flange=as_rows(shots.ring.base_from_flange_before),
                          base_from_flange_after=as_rows(shots.stripe.base_from_flange_after),
                          time=shots.ring.time, ring="", stripe="")
        return see_view(view, shots.ring.image, shots.stripe.image, self.belief,
                        design_of(self.session.header.board))

    def predicted(self) -> float:
        """Predict the uncertainty (mm) of a point after the views so far; NaN before three."""
        if len(self.known) < FEWEST_TO_PREDICT:
            return float("nan")
        place = Transform(np.array(self.session.header.base_from_board))
        return predict_point_sigma(HandEyeProblem(tuple(self.known)),
                                   self.belief.flange_from_camera, place,
                                   self.belief.sensor.working_distance)

    def _know(self, view: SeenView) -> None:
        board = locate_boards([view.board], self.belief.sensor.camera)[0]
        self.known.append(HandEyeView(view.record.pose, board))

    def _skips(self, purpose: Purpose) -> bool:
        plan = self.session.header.plan
        return (purpose == "fit" and plan.early_stop and len(self.known) >= ENOUGH
                and self.session.header.what == "hand-eye" and self.predicted() <= plan.goal_mm)

    def _go(self, joints: tuple[float, ...]) -> None:
        start = self.session.header.targets[0][1]
        here = self.station.robot.state().joints
        drive(self.station, free_path(self.belief, here, joints, start))

    def _again(self, number: int, status: str) -> bool:
        """Ask what to do with a view that carries no board."""
        if self.operator is None:
            return False
        answer = self.operator.choose(f"view {number}: {status}", ("retake", "skip", "quit"))
        if answer == "quit":
            raise DocumentError("stopped by the operator; --resume goes on",
                                source=str(self.session.folder))
        return answer == "retake"

    @property
    def _last(self) -> int:
        return len(self.session.header.targets) - 1

    def _tell(self, line: str) -> None:
        if self.operator is not None:
            self.operator.tell(line)


def _figure(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3f}"
