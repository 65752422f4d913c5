"""What a session is worth so far, and whether it may stop early."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cell.core.documents.calibration_session import SessionHeader
from cell.core.geometry import Transform
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.gates import Checked
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeView
from cell.metrology.calibrate.pose_planning import predict_point_sigma
from cell.metrology.calibrate.progress import GatheredView, check_progress
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.recorded import read_gates
from cell.programs.calibration.seen import SeenView

FEWEST_TO_PREDICT = 3
STEPS = {"camera": ("camera",), "light-plane": ("light_plane",), "hand-eye": ("hand_eye",),
         "all": ("camera", "light_plane", "hand_eye")}


class Progress:
    """The views that will be fitted to, by number, and what follows from them."""

    def __init__(self, header: SessionHeader, belief: Belief) -> None:
        self._header, self._belief = header, belief
        self._gates = read_gates().level(header.plan.gates)
        self._views: dict[int, tuple[SeenView, GatheredView]] = {}

    def __contains__(self, number: int) -> bool:
        return number in self._views

    def know(self, view: SeenView) -> None:
        """Count a view in, if it is one to be fitted to."""
        if view.record.purpose == "fit" and view.record.place == 0:
            board = locate_boards([view.board], self._belief.sensor.camera)[0]
            self._views[view.record.number] = view, GatheredView(view.board, board, view.stripe)
            self._forget_findings()

    def forget(self, number: int) -> None:
        """Count a view out: taken again, it was of no use."""
        self._views.pop(number, None)
        self._forget_findings()

    @property
    def gathered(self) -> tuple[GatheredView, ...]:
        """The views so far, in the order in which they were first taken."""
        return tuple(gathered for _, gathered in self._views.values())

    @property
    def has_goal(self) -> bool:
        """Whether there is an uncertainty to come down to: that of the hand-eye."""
        return self._header.what in ("hand-eye", "all")

    @property
    def at_goal(self) -> bool:
        """Whether the goal is reached, and every gate passed that can be told by now."""
        return (self.predicted <= self._header.plan.goal_mm
                and bool(self.checks) and all(check.verdict == "pass" for check in self.checks))

    @cached_property
    def predicted(self) -> float:
        """The uncertainty (mm) of a point at the working distance, as the views so far allow; NaN
        before the third, and where there is no goal.
        """
        if not self.has_goal or len(self._views) < FEWEST_TO_PREDICT:
            return float("nan")
        place = Transform(np.array(self._header.boards[0].base_from_board))
        problem = HandEyeProblem(tuple(HandEyeView(view.record.pose, gathered.board)
                                       for view, gathered in self._views.values()))
        return predict_point_sigma(problem, self._belief.flange_from_camera, place,
                                   self._belief.sensor.working_distance)

    @cached_property
    def checks(self) -> tuple[Checked, ...]:
        """The gates that can be told by now; none before the third view."""
        if len(self._views) < FEWEST_TO_PREDICT:
            return ()
        return check_progress(self.gathered, self._belief.sensor.camera, self._gates,
                              STEPS[self._header.what])

    def _forget_findings(self) -> None:
        for name in ("predicted", "checks"):
            self.__dict__.pop(name, None)
