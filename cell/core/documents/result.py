"""What came out: of one hole (measured, or not and why), of one feature (judged), of one body."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from cell.core.geometry import Array

Verdict: TypeAlias = Literal["in_tolerance", "out_of_tolerance", "uncertain", "not_measured"]
BodyVerdict: TypeAlias = Literal["in_tolerance", "out_of_tolerance", "uncertain", "incomplete"]


@dataclass(frozen=True, eq=False)
class Located:
    """A circle in the camera frame: mm.

    `covariance` (4, 4) of x, y, z and the radius; `normal` (3,) unit, towards the camera, None
    where the method does not estimate one. `budget` maps each source of uncertainty to its share
    (standard, x y z radius); `quality` holds what the gates looked at. `trace` is for the eye, in
    raw pixels: `rim` (n, 2), `ellipse` (k, 2) closed, `stripe` (m, 2), `chord` (2, 2) the points A
    and B, `q` (2,), `centre` (2,). `sources` holds the covariance (4, 4) behind each share.
    """

    method: str
    centre: Array
    radius: float
    normal: Array | None
    covariance: Array
    budget: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    quality: dict[str, float] = field(default_factory=dict)
    trace: dict[str, Array] = field(default_factory=dict)
    sources: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Measured:
    """A hole in the body frame: mm, on the face that the nominal lies on.

    `covariance` (4, 4) of x, y, z and the diameter in the body frame, hand-eye, robot and
    registration included. `located` is the estimate in the camera frame of the view `reference`
    (index into the observation's views), `two_step` the paper's plain result beside it.
    """

    hole_id: str
    centre: Array
    diameter: float
    covariance: Array
    normal: Array | None
    located: Located
    two_step: Located
    reference: int
    budget: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class NotMeasured:
    """A hole that carries no measurement: a documented short `reason` and a sentence."""

    hole_id: str
    reason: str
    detail: str


Outcome: TypeAlias = Measured | NotMeasured


@dataclass(frozen=True, eq=False)
class Feature:
    """One hole, judged. Dictionaries go by axis (`x`, `y`, `z`, `d`), in mm, in the body frame
    after alignment; what is not controlled is absent from `nominal`, `deviation` and `tolerance`.
    `uncertainty` is standard (k = 1). `outcome` is what the judgement was made from: its centre and
    diameter are the raw values, before temperature, alignment and `offset` (the CMM correlation).
    `bias` is measured minus the master body's CMM reference. `in_plane` and `along_normal` part the
    whole deviation of the centre; `true_position` is the diameter of the zone that it needs.
    """

    id: str
    verdict: Verdict
    outcome: Outcome
    nominal: dict[str, float]
    tolerance: dict[str, float]
    measured: dict[str, float] | None = None
    deviation: dict[str, float] | None = None
    uncertainty: dict[str, float] | None = None
    axis_verdicts: dict[str, Verdict] = field(default_factory=dict)
    in_plane: float | None = None
    along_normal: float | None = None
    true_position: float | None = None
    bias: dict[str, float] = field(default_factory=dict)
    offset: dict[str, float] = field(default_factory=dict)

    @property
    def reason(self) -> str | None:
        """Why it was not measured, or None."""
        return self.outcome.reason if isinstance(self.outcome, NotMeasured) else None


@dataclass(frozen=True, eq=False)
class BodyResult:
    """All features of a body, and what the alignment did (a 4x4 row list, residuals by datum).

    The verdict is out of tolerance where one feature is; else incomplete where one is not measured;
    else uncertain where one is, or where body, base or sensor moved further than the job allows.
    """

    verdict: BodyVerdict
    features: tuple[Feature, ...]
    alignment: dict[str, Any] = field(default_factory=dict)
