"""What the live view shows of a calibration: one moment of it, whole, so that any may be lost."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from cell.core.geometry import Array, Transform
from cell.core.observation import Image
from cell.core.optics import CameraModel

ViewState: TypeAlias = Literal["planned", "next", "taken", "left out"]


def no_pixels() -> Array:
    """Nothing found: (0, 2)."""
    return np.zeros((0, 2))


@dataclass(frozen=True)
class Line:
    """One line of the panel: what, how much, what is wanted; `good` is None where nothing is."""

    name: str
    value: str
    wanted: str = ""
    good: bool | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as it was taken, and the pixels (n, 2) that were found in it."""

    image: Image
    found: Array


@dataclass(frozen=True, eq=False)
class PlannedView:
    """A view of the plan: where the camera will be, or was."""

    number: int
    base_from_camera: Transform
    apart: bool
    state: ViewState = "planned"


@dataclass(frozen=True, eq=False)
class CalibrationMoment:
    """One moment of a session.

    Attributes:
        session: tells this session from others.
        title: what is calibrated, in which cell.
        camera: the one that is believed.
        look: counts the moments; the time line of the live view.
        step: what is going on; `advice`: what the operator is to do now.
        lines: the figures of this moment.
        ring, laser: the newest pictures, None before the first.
        base_from_camera: where the camera stands.
        boards: the outlines (4, 3) of the boards in the base frame, mm.
        sphere: the centre (3,) and the radius of the sphere, mm.
        planned: the views of the plan.
        corners: pixels (n, 2) of all views to be fitted to, so far.
        leans: (n, 3) degrees: how each of them leaned to the right and down, and rolled.
        figures: what is drawn over time, by name.
        predicted: the uncertainty (mm) that the views so far allow, NaN where there is none.
        goal: to which it is to fall, NaN where there is none.
        results: the pictures of the report, title and PNG, once there is a solution.
    """

    session: str
    title: str
    camera: CameraModel
    look: int = 0
    step: str = ""
    advice: str = ""
    lines: tuple[Line, ...] = ()
    ring: Picture | None = None
    laser: Picture | None = None
    base_from_camera: Transform | None = None
    boards: tuple[Array, ...] = ()
    sphere: tuple[Array, float] | None = None
    planned: tuple[PlannedView, ...] = ()
    corners: Array = field(default_factory=no_pixels)
    leans: Array = field(default_factory=lambda: np.zeros((0, 3)))
    figures: tuple[tuple[str, float], ...] = ()
    predicted: float = float("nan")
    goal: float = float("nan")
    results: tuple[tuple[str, bytes], ...] = ()

    @property
    def extent(self) -> tuple[int, ...]:
        """How much there is to look at: boards, views of a plan, pictures of the result."""
        return len(self.boards), len(self.planned), len(self.results)
