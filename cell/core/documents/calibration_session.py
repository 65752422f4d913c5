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

Purpose = Literal["start", "fit", "hold_out", "sphere"]


class CalibrationPlan(Document):
    """`--plan FILE`: how a session is to be run; every key has a default.

    `goal_mm` is the predicted uncertainty of a point at which capturing may stop early. `reason`
    is recorded where a warning is accepted; without one, warnings are not accepted unattended.
    `kinematics` has the arm's own rows estimated too, where views kept apart gain by it.
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
    activate: bool = True
    reason: str = ""


class SessionHeader(Document):
    """`session.json`: what must not change during a session, and what was planned."""

    version: Literal[1] = 1
    cell: str
    what: Literal["camera", "light-plane", "hand-eye", "all"]
    begun: str
    base_set: str
    robot: RobotRecord
    sensor_serial: str | None
    board: BoardDocument
    sphere: SphereDocument | None = None
    plan: CalibrationPlan
    base_from_board: Matrix4
    targets: tuple[tuple[Purpose, Vector6], ...]  # joints in rad, in the order of capture


class ViewRecord(Document):
    """One line of `views.jsonl`: one stop, two pictures, where the flange stood before and after.

    `ring` and `stripe` name the pictures; `status` other than `ok` is why the view is not used.
    """

    number: int
    purpose: Purpose
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
