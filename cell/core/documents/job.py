"""`jobs/<job>.yaml`: what to measure on one type of body, how to align and how to judge."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cell.core.documents.base import Document, Number, Vector3, Vector6
from cell.core.documents.station import NotNegative, Positive

Identifier = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]


class Via(Document):
    """A point on the way, in joints."""

    joints_deg: Vector6


class Stop(Document):
    """One stop. With `joints_deg` the pose is taught; without, it is computed from the nominal, its
    normal and the stand-off. `roll_deg` turns the sensor about its optic axis (at 0 the image is
    upright: its y axis points to the body's -z), `tilt_deg` leans it about the image's x axis.
    """

    hole: Identifier
    joints_deg: Vector6 | None = None
    roll_deg: Number = 0.0
    tilt_deg: Annotated[Number, Field(ge=-45, le=45)] = 0.0
    via: tuple[Via, ...] = ()


class Alignment(Document):
    """How the measured body is laid onto the drawing: as the fixture holds it, by 3-2-1 (each datum
    constrains its listed axes), or by a weighted best fit over `datums`.
    """

    method: Literal["fixture", "rps", "best_fit"] = "fixture"
    datums: dict[str, str] = Field(default_factory=dict)  # hole id -> axes of xyz that it holds
    limit_mm: Positive = 2.0


class Thermal(Document):
    """How the part's temperature is taken out: lengths from `fixed_point` (mm, body frame: where
    the fixture holds the body) and diameters are scaled to 20 degrees C. The temperature entered
    here counts where none is measured.
    """

    expansion_per_kelvin: Annotated[Number, Field(ge=0, le=1e-4)]  # steel 11.5e-6, aluminium 23e-6
    part_temperature_c: Annotated[Number, Field(ge=-40, le=80)]
    fixed_point: Vector3 = (0.0, 0.0, 0.0)


class Decision(Document):
    """How a deviation becomes a verdict. `guarded` is ISO 14253-1: the tolerance shrinks by the
    guard band of `confidence`, and what lies in the band is `uncertain`.
    """

    rule: Literal["simple", "guarded"] = "simple"
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95


class Retry(Document):
    """How far a hole is chased: tries in all, and how long they may take on one body."""

    attempts: Annotated[int, Field(ge=1, le=6)] = 3
    recentre: bool = True
    recentre_limit_mm: Positive = 6.0
    budget_share: Annotated[float, Field(gt=0, le=1)] = 0.25  # of the tolerance, for U = 2 u
    time_s: NotNegative = 30.0


class JobDocument(Document):
    """A job as a whole. `nominals` is a CSV file beside it; `stops` default to one a hole, in the
    order of the nominals; `stand_off_mm` defaults to the sensor's working distance.
    """

    name: Identifier
    cell: Identifier
    nominals: str
    body_type: str = ""
    stand_off_mm: Positive | None = None
    method: Literal["joint", "two-step"] = "joint"
    normal_sigma_deg: Positive = 0.35
    alignment: Alignment = Alignment()
    decision: Decision = Decision()
    thermal: Thermal | None = None
    retry: Retry = Retry()
    stops: tuple[Stop, ...] = ()
