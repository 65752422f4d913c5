"""The capture loop: one line a view; retake, skip, pause, quit at any; early stop at the goal."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from cell.core.documents.calibration_session import Target
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.ports import Operator
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.capture import Shots, describe, drive, record, record_skipped, shoot
from cell.programs.calibration.poses import free_path
from cell.programs.calibration.progress import Progress
from cell.programs.calibration.seen import see_again, see_view
from cell.programs.calibration.session import Session
from cell.programs.calibration.shown import Shown
from cell.programs.calibration.sphere import see_sphere
from cell.programs.station import Station

TRIES = 3
KEYS = {"p": "pause", "r": "retake", "s": "skip", "q": "quit"}
SAY_KEYS = "p pause, r retake the last view, s skip the next, q quit"
PAUSED = "Paused: the arm stands, the lights are off."


@dataclass(eq=False)
class Gathering:
    """Captures what a session still lacks."""

    session: Session
    belief: Belief
    station: Station
    operator: Operator
    shown: Shown
    progress: Progress = field(init=False)

    def __post_init__(self) -> None:
        self.progress = Progress(self.session.header, self.belief)
        self._targets = self.session.header.numbered
        self._place, self._done = self._opened_at(), False

    def _opened_at(self) -> int:
        """Name the board that the arm was left at: that of the old view that was looked at again,
        or the last one whose start view was found.
        """
        views = self.session.board_views
        return views[-1].place if views else len(self.session.header.boards) - 1

    def gather(self) -> None:
        """Capture all planned views that are not on the disk yet.

        Raises:
            DeviceError: a device failed; the views until then are on the disk.
            DocumentError: the operator quit, or the disk refuses.
        """
        self._take_up()
        known = {view.number for view in self.session.views}
        waiting, last = deque(sorted(set(self._targets) - known)), 0
        while waiting:
            number = waiting.popleft()
            if self._is_spared(number):
                continue
            wish = self._arrive(number)
            if wish == "retake":
                waiting.extendleft([number] if last in (0, number) else [number, last])
                continue
            if wish == "skip":
                self._skip(number)
            else:
                self._capture(number)
            last = number
        self._say_how_far()

    def _take_up(self) -> None:
        """See again what is on the disk."""
        for view in self.session.board_views:
            self.progress.know(see_again(view, self.session, self.belief))
        self.shown.plan(self.session.header, self.session.views)

    def _is_spared(self, number: int) -> bool:
        """Tell whether a view to be fitted to is not needed any more: the goal is reached."""
        target, plan = self._targets[number], self.session.header.plan
        if (target.purpose, target.place) != ("fit", 0) or number in self.progress:
            return False
        if not (plan.early_stop and self.progress.at_goal):
            return False
        if not self._done:
            self._done = True
            self.operator.tell(
                f"The goal is reached with {len(self.progress.gathered)} views: predicted "
                f"uncertainty {self.progress.predicted:.3f} mm (goal {plan.goal_mm:.3f}), and "
                "every gate is passed that can be told by now. The other views to be fitted to "
                "are left out; those kept apart follow.")
        self.shown.spare(number)
        return True

    def _arrive(self, number: int) -> str:
        """Drive to a view; say what the operator wants, before the drive and on arrival."""
        self.shown.approach(number)
        wish = self._wish()
        if not wish:
            self._go(self._targets[number])
            wish = self._wish()
        return wish

    def _wish(self) -> str:
        """Follow the keys that were pressed: `retake`, `skip`, or nothing; pauses are spent here.

        Raises:
            DocumentError: the operator quit.
        """
        wish = KEYS.get(self.operator.pressed() or "", "")
        if wish == "pause":
            self.station.lights.off()
            self.shown.step("paused", PAUSED)
            wish = self.operator.choose(f"{PAUSED} How to go on?",
                                        ("continue", "retake", "skip", "quit"))
        return self._unless_quit(wish)

    def _unless_quit(self, wish: str) -> str:
        if wish == "quit":
            raise DocumentError("stopped by the operator; --resume goes on",
                                source=str(self.session.folder))
        return "" if wish == "continue" else wish

    def _go(self, target: Target) -> None:
        boards = self.session.header.boards
        here = self.station.robot.state().joints
        drive(self.station, free_path(self.belief, here, target.joints, boards[self._place].start,
                                      self.belief.home, boards[target.place].start))
        self._place = target.place

    def _skip(self, number: int) -> None:
        record_skipped(self.session, number, self.station, "skipped by the operator")
        self._leave_out(number, "by the operator")

    def _capture(self, number: int) -> None:
        """Take a view, again where the arm moved or the operator wants; leave it out at last."""
        shots, status = shoot(self.station), ""
        for attempt in range(TRIES):
            shots = shoot(self.station) if attempt else shots
            if shots.moved(self.station):
                status = "the robot moved"
                continue
            try:
                self._keep(shots, number)
            except UnmeasurableError as error:
                status = error.detail
                self.shown.nothing(shots, status)
                if self._ask_after(number, status) != "retake":
                    break
            else:
                return
        record(self.session, number, shots, 0, status)
        self._leave_out(number, status)

    def _ask_after(self, number: int, status: str) -> str:
        return self._unless_quit(self.operator.choose(
            f"view {number}: {status}", ("retake", "skip", "quit")))

    def _leave_out(self, number: int, why: str) -> None:
        self.progress.forget(number)
        self.shown.spare(number)
        self.operator.tell(f"{self._counted(number)} skipped: {why}")

    def _keep(self, shots: Shots, number: int) -> None:
        if self._targets[number].purpose == "sphere":
            self._keep_sphere(shots, number)
        else:
            self._keep_board(shots, number)

    def _keep_sphere(self, shots: Shots, number: int) -> None:
        assert self.session.header.sphere is not None
        look = see_sphere(shots.stripe.image, shots.stripe.base_from_flange_before,
                          shots.stripe.joints, self.session.header.sphere, self.belief)
        record(self.session, number, shots, 0, "ok")
        self.shown.sphere(number, shots, look.pixels)
        self.operator.tell(f"{self._counted(number)} ok sphere   {len(look.pixels)} points of the "
                           "stripe")

    def _keep_board(self, shots: Shots, number: int) -> None:
        target = self._targets[number]
        board = self.session.header.boards[target.place].board
        view = see_view(describe(self.session, number, shots), shots.ring.image,
                        shots.stripe.image, self.belief, board)
        record(self.session, number, shots, len(view.board.pixels), "ok")
        before = self.progress.predicted
        self.progress.know(view)
        self.shown.board(view, shots, self.progress)
        where = f" at {board.id}" if target.place else ""
        stripe = "" if view.stripe is not None else ", no stripe"
        self.operator.tell(f"{self._counted(number)} ok {target.purpose:8} "
                           f"{len(view.board.pixels)} corners{stripe}{where}"
                           f"{self._fallen(before) if number in self.progress else ''}")

    def _fallen(self, before: float) -> str:
        """Say how far the predicted uncertainty has come down, and what is missing yet."""
        missing = next((check for check in self.progress.checks if check.verdict != "pass"), None)
        lacks = "" if missing is None else \
            f" | {missing.meaning}: {missing.value:.3g} ({missing.bound})"
        if not self.progress.has_goal:
            return lacks
        return (f" | predicted {_figure(before)} -> {_figure(self.progress.predicted)} mm (goal "
                f"{self.session.header.plan.goal_mm:.3f}){lacks}")

    def _say_how_far(self) -> None:
        goal = self.session.header.plan.goal_mm
        if self.progress.has_goal and not self.progress.predicted <= goal:
            self.operator.tell(f"The goal of {goal:.3f} mm is not reached: the views predict "
                               f"{_figure(self.progress.predicted)} mm. Plan more views, or views "
                               "that lean and roll more.")

    def _counted(self, number: int) -> str:
        return f"{number:02}/{len(self._targets)}"


def _figure(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3f}"
