"""`jobs/<shift>.yaml`: which cell measures which bodies, in what time, and what to do on faults."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cell.core.documents.base import Document
from cell.core.documents.job import Identifier
from cell.core.documents.station import NotNegative, Positive

TypeNumber = Annotated[int, Field(ge=1, le=65535)]
Count = Annotated[int, Field(ge=1)]


class BodyType(Document):
    """One type of body, by the line's number for it, and the job that measures it."""

    type: TypeNumber
    job: str


class Takt(Document):
    """How long a body may take. Where the rest does not fit, holes whose class is in `droppable`
    are dropped, the first class first; a hole of any other class never is. `hole_s` is the time
    that a hole is thought to take before the cell knows better.
    """

    seconds: Positive
    droppable: tuple[str, ...] = ("minor",)
    hole_s: Positive = 4.0
    reserve_s: NotNegative = 3.0

    @model_validator(mode="after")
    def _critical_stays(self) -> Takt:
        if "critical" in self.droppable:
            raise ValueError("holes of the class `critical` are never dropped")
        return self


class MasterCheck(Document):
    """The master body, which comes as type `type` at the start and after every `every` bodies. Its
    holes are compared with what a CMM measured on it, or else with the nominals, to `limit_mm`.
    """

    type: TypeNumber
    job: str
    every: Count = 200
    limit_mm: Positive = 0.15


class FaultRules(Document):
    """When not measured holes are a fault of the cell: so many in a row, or a missing datum."""

    refused_in_a_row: Count = 4
    datum_missing: bool = True


class BypassRules(Document):
    """How long bodies may pass unmeasured, and the plant's list of reasons by number."""

    at_most_min: Positive = 60.0
    reasons: dict[str, str] = Field(default_factory=dict)


class LineSettings(Document):
    """How the line is reached: a Modbus TCP server at `address` and `port`, or a person."""

    driver: Literal["modbus", "manual"] = "modbus"
    address: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 5020
    patience_s: Positive = 3.0


class Simulation(Document):
    """What the virtual line of `--simulate` brings: the bodies of the scene's body shop from number
    `first` on; every `unknown_every`-th is of a type that nobody has told the cell (0: none).
    Somebody presses reset `repair_s` after a fault.
    """

    first: Annotated[int, Field(ge=0)] = 1
    unknown_every: Annotated[int, Field(ge=0)] = 0
    repair_s: NotNegative = 2.0


class ShiftDocument(Document):
    """A shift as a whole. Jobs are files beside this one; `results` is the URL of a plant's
    database that is written beside the cell's own.
    """

    name: Identifier
    cell: Identifier
    bodies: tuple[BodyType, ...] = Field(min_length=1)
    takt: Takt | None = None
    master: MasterCheck | None = None
    faults: FaultRules = FaultRules()
    bypass: BypassRules = BypassRules()
    line: LineSettings = LineSettings()
    results: str | None = None
    simulation: Simulation = Simulation()

    @model_validator(mode="after")
    def _types_are_unique(self) -> ShiftDocument:
        types = [body.type for body in self.bodies]
        types += [self.master.type] if self.master else []
        if len(set(types)) < len(types):
            raise ValueError("each type may be named once, and the master's is its own")
        return self

    def job_of(self, body_type: int) -> str | None:
        """Find the job for a type of body; None for one that nobody has told the cell."""
        jobs = {body.type: body.job for body in self.bodies}
        if self.master:
            jobs[self.master.type] = self.master.job
        return jobs.get(body_type)

    def is_master(self, body_type: int) -> bool:
        """Tell whether a body of this type is the master."""
        return self.master is not None and body_type == self.master.type
