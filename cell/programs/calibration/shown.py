"""What the live view is told of a session. Without a viewer nothing is; the session never waits."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cell.core.documents.calibration_session import SessionHeader, ViewRecord
from cell.core.geometry import Array, Transform
from cell.core.observation import View
from cell.metrology.calibrate.gates import Checked
from cell.metrology.calibrate.progress import GatheredView
from cell.programs.calibration.belief import Belief, design_of
from cell.programs.calibration.capture import Shots
from cell.programs.calibration.progress import Progress
from cell.programs.calibration.seen import SeenView
from cell.programs.calibration.start_look import StartLook
from cell.recording.calibration_moment import (
    CalibrationMoment,
    Line,
    Picture,
    PlannedView,
    ViewState,
    no_pixels,
)
from cell.recording.live import LiveView
from cell.report.calibration import CalibrationPage, draw_pictures


class Shown:
    """Keeps the moment that is shown, and sends it whenever it changes."""

    def __init__(self, belief: Belief, what: str, session: str, live: LiveView | None) -> None:
        self._belief, self._live = belief, live
        self._moment = CalibrationMoment(
            session, f"{what}, cell {belief.folder.name}", belief.sensor.camera,
            boards=tuple(board.rough_place @ design_of(board).outline
                         for board in belief.targets.boards))

    def step(self, step: str, advice: str = "") -> None:
        """Show what is going on."""
        self._show(step=step, advice=advice)

    def looked(self, look: StartLook) -> None:
        """Show a look at the start view, with the figures that one jogs by."""
        found = no_pixels() if look.seen is None else look.seen.view.pixels
        self._show(ring=Picture(look.view.image, found), laser=None,
                   base_from_camera=self._camera(look.view),
                   lines=look.lines, figures=tuple(look.figures.items()))

    def plan(self, header: SessionHeader, views: Sequence[ViewRecord] = ()) -> None:
        """Show the planned views, and which of them are there already."""
        done = {view.number: view.status == "ok" for view in views}
        states: dict[bool | None, ViewState] = {None: "planned", True: "taken", False: "left out"}
        self._show(step="plan", advice="These views are planned. Answer at the terminal.", lines=(),
                   planned=tuple(
                       PlannedView(number, self._reached(target.joints), target.purpose != "fit",
                                   states[done.get(number)])
                       for number, target in header.numbered.items()), **self._fixed(header))

    def approach(self, number: int) -> None:
        """Show that the arm is on its way to a view."""
        self._show(step=f"view {number:02} of {len(self._moment.planned)}", advice="The arm moves. "
                   "Keys: p pause, r retake the last view, s skip this one, q quit.",
                   planned=self._with_state(number, "next"))

    def board(self, view: SeenView, shots: Shots, progress: Progress) -> None:
        """Show a view of a board that was taken."""
        stripe = no_pixels() if view.stripe is None else view.stripe
        self._show(ring=Picture(shots.ring.image, view.board.pixels),
                   laser=Picture(shots.stripe.image, stripe),
                   base_from_camera=self._camera(shots.ring),
                   planned=self._with_state(view.record.number, "taken"), **_gathered(progress))

    def sphere(self, number: int, shots: Shots, stripe: Array) -> None:
        """Show a view of the sphere that was taken."""
        self._show(ring=Picture(shots.ring.image, no_pixels()),
                   laser=Picture(shots.stripe.image, stripe),
                   base_from_camera=self._camera(shots.ring),
                   planned=self._with_state(number, "taken"))

    def nothing(self, shots: Shots, why: str) -> None:
        """Show a view in which nothing was found."""
        self._show(ring=Picture(shots.ring.image, no_pixels()),
                   laser=Picture(shots.stripe.image, no_pixels()),
                   advice=f"{why}. See the terminal.",
                   base_from_camera=self._camera(shots.ring))

    def spare(self, number: int) -> None:
        """Show that a view is left out."""
        self._show(planned=self._with_state(number, "left out"))

    def concluded(self, page: CalibrationPage) -> None:
        """Show what came of it, with the pictures of the report."""
        if self._live is None:
            return
        gates = [gate for gates in page.gates.values() for gate in gates]
        self._show(step=f"verdict: {page.verdict}", lines=tuple(map(_as_line, gates)),
                   advice=" ".join(page.reasons) or "Nothing speaks against it.",
                   results=tuple((picture.title, b64decode(picture.png))
                                 for picture in draw_pictures(page)))

    def _show(self, **changes: Any) -> None:  # noqa: ANN401  the fields of a moment
        if self._live is not None:
            self._moment = replace(self._moment, look=self._moment.look + 1, **changes)
            self._live.show(self._moment)

    def _fixed(self, header: SessionHeader) -> dict[str, Any]:
        """What stands in the cell, and the goal."""
        outlines = tuple(Transform(np.array(one.base_from_board)) @ design_of(one.board).outline
                         for one in header.boards)
        sphere = header.sphere and (np.array(header.sphere.centre), header.sphere.radius_mm)
        return {"boards": outlines, "sphere": sphere, "goal": header.plan.goal_mm}

    def _with_state(self, number: int, state: ViewState) -> tuple[PlannedView, ...]:
        return tuple(replace(view, state=state) if view.number == number else view
                     for view in self._moment.planned)

    def _reached(self, joints: Sequence[float]) -> Transform:
        return self._belief.arm.forward(joints) @ self._belief.flange_from_camera

    def _camera(self, view: View) -> Transform:
        return self._belief.chain.base_from_camera(view.base_from_flange_before, view.joints)


def _gathered(progress: Progress) -> dict[str, Any]:
    views = progress.gathered
    return {"corners": np.vstack([no_pixels(), *(view.seen.pixels for view in views)]),
            "leans": np.array([_lean(view) for view in views]).reshape(-1, 3),
            "predicted": progress.predicted, "lines": tuple(map(_as_line, progress.checks))}


def _as_line(check: Checked) -> Line:
    return Line(check.meaning, f"{check.value:.3g}", check.bound,
                check.verdict == "pass")


def _lean(view: GatheredView) -> tuple[float, float, float]:
    """How the board leans to the right and down, and how it is rolled, in degrees."""
    rotation = view.board.camera_from_board.rotation
    right, down, away = rotation[:, 2]
    size = np.degrees(np.arccos(min(1.0, abs(away)))) / max(float(np.hypot(right, down)), 1e-9)
    return (float(size * right), float(size * down),
            float(np.degrees(np.arctan2(rotation[1, 0], rotation[0, 0]))))
