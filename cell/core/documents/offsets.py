"""`offsets/<job>.yaml`: what the CMM says of the sensor's bias, by feature and axis."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

from pydantic import Field, field_validator

from cell.core.documents.base import Document, Number, Vector6
from cell.core.documents.station import NotNegative

Date = Annotated[str, Field(pattern=r"^\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])$")]
"""A day as 2026-11-22: sorts as text."""


class Offset(Document):
    """One correlation offset: CMM minus sensor, the mean over `sample_size` runs or bodies.

    It holds at the stop where it was learnt, `joints_deg`, and until the end of the day `expires`.
    `spread_mm` is the standard deviation of the paired differences, `repeatability_mm` that of one
    measurement at that stop if it is known better than by these few (else the spread stands for
    it), `cmm_u_mm` the standard uncertainty of the CMM.
    """

    hole: str
    axis: Literal["x", "y", "z", "d"]
    value_mm: Number
    spread_mm: NotNegative
    sample_size: Annotated[int, Field(ge=2)]
    joints_deg: Vector6
    learnt: Date
    expires: Date
    by: str = ""
    repeatability_mm: NotNegative | None = None
    cmm_u_mm: NotNegative = 0.0

    @property
    def repeatability(self) -> float:
        """Standard deviation of one measurement at the stop, mm."""
        return self.spread_mm if self.repeatability_mm is None else self.repeatability_mm

    @property
    def variance(self) -> float:
        """The square of the offset's standard uncertainty, mm²: of its mean, and of the CMM."""
        return self.repeatability**2 / self.sample_size + self.cmm_u_mm**2


class OffsetsDocument(Document):
    """All offsets of one job on one cell."""

    offsets: tuple[Offset, ...] = ()

    @field_validator("offsets")
    @classmethod
    def _each_once(cls, offsets: tuple[Offset, ...]) -> tuple[Offset, ...]:
        counts = Counter((offset.hole, offset.axis) for offset in offsets)
        doubled = [f"{hole} {axis}" for (hole, axis), count in counts.items() if count > 1]
        if doubled:
            raise ValueError(f"the offset of {doubled[0]} stands twice")
        return offsets
