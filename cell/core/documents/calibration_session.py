"""What a calibration session leaves on disk: how it was meant, and one record a view."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from cell.core.documents.base import Document, Matrix4, Number, Vector6
from cell.core.documents.calibration import RobotRecord
from cell.core.documents.station import NotNegative, Positive
from cell.core.documents.targets import BoardDocument, SphereDocument
from cell.core.geometry import Transform

Purpose = Literal["fit", "hold_out", "sphere"]
What = Literal["camera", "light-plane", "hand-eye", "all"]
NotNegativeInt = Annotated[int, Field(ge=0)]
SCHEMA: Literal[2] = 2


class CalibrationPlan(Document):
    """`--plan FILE`: how a session is to be run; every key has a default.

    `goal_mm` is the predicted uncertainty of a point at which capturing may stop early. `reason`
    is recorded where a warning is accepted; without one, warnings are not accepted unattended.
    `kinematics` has the arm's own rows estimated too and kept where views kept apart gain by it;
    that takes boards in two places or more, and `views_elsewhere` of each further one.
    `sphere_views` look at the cell's sphere in the end, a check that nothing is fitted to; 0 leaves
    it out.
    """

    operator: str = "unattended"
    board: str | None = None
    views: Annotated[int, Field(ge=6, le=80)] = 20
    hold_out: Annotated[int, Field(ge=0, le=10)] = 5
    sphere_views: Annotated[int, Field(ge=0, le=20)] = 8
    goal_mm: Positive = 0.06
    early_stop: bool = True
    lean_deg: Positive = 32.0
    roll_deg: Positive = 90.0
    depth_mm: Positive = 22.0
    aside_mm: NotNegative = 6.0
    gates: Literal["fine", "coarse"] = "fine"
    kinematics: bool = False
    views_elsewhere: Annotated[int, Field(ge=6, le=40)] = 10
    activate: bool = True
    reason: str = ""


class Precondition(Document):
    """One line of the first screen: what was found, what was wanted, and what to make of it.

    `asked` is for what no device can tell: the operator confirmed it.
    """

    item: str
    found: str
    wanted: str
    verdict: Literal["pass", "asked", "warn", "refuse"] = "pass"
    advice: str = ""

    def __str__(self) -> str:
        return f"{self.item}: {self.found}, wanted: {self.wanted}"


class PlacedBoard(Document):
    """A board of the session: where it was found to stand, and the joints (rad) of its start view,
    from which all of its views can be reached.
    """

    board: BoardDocument
    base_from_board: Matrix4
    start: Vector6


class Target(Document):
    """One planned stop: joints (rad), and the place of its board among those of the session."""

    purpose: Purpose
    joints: Vector6
    place: NotNegativeInt = 0


class SessionHeader(Document):
    """`session.json`: what must not change during a session, and what was planned.

    The first board is the one that camera, light plane and hand-eye are found with; views of
    others tell of the arm's own kinematics. Targets are counted from 1, in the order of capture.
    `accepted` is why preconditions that only warned were accepted.
    """

    version: Literal[2] = SCHEMA
    cell: str
    what: What
    begun: str
    base_set: str
    robot: RobotRecord
    sensor_serial: str | None
    boards: Annotated[tuple[PlacedBoard, ...], Field(min_length=1)]
    sphere: SphereDocument | None = None
    plan: CalibrationPlan
    preconditions: tuple[Precondition, ...] = ()
    accepted: str = ""
    targets: tuple[Target, ...]

    @property
    def board(self) -> BoardDocument:
        """The first board."""
        return self.boards[0].board

    @property
    def warnings(self) -> tuple[Precondition, ...]:
        """The preconditions that were accepted though they are not met."""
        return tuple(one for one in self.preconditions if one.verdict == "warn")

    @property
    def numbered(self) -> dict[int, Target]:
        """The targets by their numbers."""
        return dict(enumerate(self.targets, 1))


class ViewRecord(Document):
    """One line of `views.jsonl`: one stop, two pictures, where the flange stood before and after.

    `ring` and `stripe` name the pictures; `status` other than `ok` is why the view is not used. A
    later line of the same number is the view taken again. `temperatures` are the joints' (C).
    """

    number: int
    purpose: Purpose
    place: NotNegativeInt = 0
    joints: Vector6
    base_from_flange: Matrix4
    base_from_flange_after: Matrix4
    time: Number
    ring: str
    stripe: str
    corners: int = 0
    status: str = "ok"
    temperatures: tuple[Number, ...] = ()

    @property
    def pose(self) -> Transform:
        """The flange as it stood before the exposures."""
        return Transform(np.array(self.base_from_flange))

    @property
    def pose_after(self) -> Transform:
        """The flange as it stood after them."""
        return Transform(np.array(self.base_from_flange_after))
