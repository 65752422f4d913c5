"""The papers of a run: from their exact texts to documents that belong together.

Live and audit come in by this one door, so what is measured is what is recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np

from cell.core.documents.calibration import (
    BodyDocument,
    Calibration,
    HandEyeDocument,
    KinematicsDocument,
    RobotRecord,
    SensorDocument,
)
from cell.core.documents.complaint import name_place
from cell.core.documents.job import JobDocument
from cell.core.documents.nominals import Hole
from cell.core.documents.nominals_table import read_nominals
from cell.core.documents.offsets import OffsetsDocument
from cell.core.documents.station import StationDocument
from cell.core.documents.strict_yaml import Path, read_tree
from cell.core.documents.text import Model, parse
from cell.core.errors import DocumentError
from cell.core.ports import RobotIdentity

Contradiction: TypeAlias = tuple[str, Path, str]
"""Which document, where in it, and what is wrong."""

NEEDED = ("job", "nominals", "cell", "sensor", "hand_eye", "body")
TCP_TOLERANCE = 1e-3  # mm, and rad: what a controller's rounding costs
PAYLOAD_TOLERANCE_KG = 0.01
RPS_CONSTRAINTS, BEST_FIT_DATUMS = 6, 3


@dataclass(frozen=True, eq=False)
class Papers:
    """All documents of a run. `texts` are their exact words by name, as a recording keeps them;
    `sources` says where each was read, for messages.
    """

    texts: Mapping[str, str]
    set_id: str
    job: JobDocument
    holes: tuple[Hole, ...]
    station: StationDocument
    calibration: Calibration
    offsets: OffsetsDocument | None = None
    sources: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, texts: Mapping[str, str], set_id: str,
              sources: Mapping[str, str] | None = None) -> Papers:
        """Parse `job`, `nominals`, `cell`, `sensor`, `hand_eye`, `body` and where they exist
        `offsets` and `kinematics`, and check that they belong together.

        Raises:
            DocumentError: names the document (by `sources`, else by its name), place, and what
                was expected.
        """
        where = {name: (sources or {}).get(name, name) for name in texts}
        missing = [name for name in NEEDED if name not in texts]
        if missing:
            raise DocumentError(f"missing: {', '.join(missing)}", source="papers")
        papers = _parse(texts, set_id, where)
        for name, path, problem in _contradictions(papers):
            lines = read_tree(texts[name], where[name])[1]
            raise DocumentError(problem, source=where[name], place=name_place(path, lines))
        return papers

    def hole(self, hole_id: str) -> Hole:
        """Find a hole by its id; KeyError where there is none."""
        return self._by_id[hole_id]

    @property
    def planned_holes(self) -> tuple[Hole, ...]:
        """The holes that the job measures, in its order."""
        return tuple(self.hole(stop.hole) for stop in self.job.stops) or self.holes

    @cached_property
    def _by_id(self) -> dict[str, Hole]:
        return {hole.id: hole for hole in self.holes}


def _parse(texts: Mapping[str, str], set_id: str, where: Mapping[str, str]) -> Papers:
    def read(model: type[Model], name: str) -> Model:
        return parse(model, texts[name], where[name])

    def read_if_there(model: type[Model], name: str) -> Model | None:
        return read(model, name) if name in texts else None

    calibration = Calibration(set_id, read(SensorDocument, "sensor"),
                              read(HandEyeDocument, "hand_eye"), read(BodyDocument, "body"),
                              read_if_there(KinematicsDocument, "kinematics"))
    return Papers(texts, set_id, read(JobDocument, "job"),
                  read_nominals(texts["nominals"], where["nominals"]),
                  read(StationDocument, "cell"), calibration,
                  read_if_there(OffsetsDocument, "offsets"), where)


def _contradictions(papers: Papers) -> Iterator[Contradiction]:
    """Find what each document alone cannot know."""
    yield from _job_against_nominals(papers)
    yield from _alignment(papers)
    yield from _set_against_cell(papers)
    yield from _offsets_against_nominals(papers)


def _job_against_nominals(papers: Papers) -> Iterator[Contradiction]:
    known, seen = {hole.id for hole in papers.holes}, set()
    for index, stop in enumerate(papers.job.stops):
        place = ("stops", index, "hole")
        if stop.hole not in known:
            yield "job", place, _unknown_hole(stop.hole, papers)
        if stop.hole in seen:
            yield "job", place, f"the hole {stop.hole!r} has two stops; expected one"
        seen.add(stop.hole)


def _alignment(papers: Papers) -> Iterator[Contradiction]:
    alignment, known = papers.job.alignment, {hole.id for hole in papers.holes}
    visited = {stop.hole for stop in papers.job.stops} or known
    for hole_id, axes in alignment.datums.items():
        place = ("alignment", "datums", hole_id)
        if hole_id not in known:
            yield "job", place, _unknown_hole(hole_id, papers)
        if hole_id not in visited:
            yield "job", place, f"the datum {hole_id!r} has no stop, so it is never measured"
        if not axes or set(axes) - set("xyz") or len(set(axes)) < len(axes):
            yield "job", place, f"expected some of the axes xyz, each once; came {axes!r}"
    constraints = sum(map(len, alignment.datums.values()))
    if alignment.method == "rps" and constraints < RPS_CONSTRAINTS:
        yield ("job", ("alignment",), f"3-2-1 needs at least {RPS_CONSTRAINTS} constrained axes; "
               f"the datums hold {constraints}")
    if alignment.method == "best_fit" and len(alignment.datums) < BEST_FIT_DATUMS:
        yield ("job", ("alignment",), f"a best fit needs at least {BEST_FIT_DATUMS} datums; "
               f"came {len(alignment.datums)}")


def _set_against_cell(papers: Papers) -> Iterator[Contradiction]:
    robot, made_with = papers.station.robot, papers.calibration.hand_eye.robot
    sensor, hand_eye = papers.calibration.sensor, papers.calibration.hand_eye
    body, kinematics = papers.calibration.body, papers.calibration.kinematics
    if made_with.model != robot.model:
        yield ("hand_eye", ("robot", "model"), f"calibrated on a {made_with.model}; the cell has a "
               f"{robot.model}")
    if robot.serial is not None and made_with.serial != robot.serial:
        yield ("hand_eye", ("robot", "serial"), f"calibrated on the robot {made_with.serial}; the "
               f"cell's is {robot.serial}")
    if None not in (sensor.serial, hand_eye.sensor_serial) \
            and sensor.serial != hand_eye.sensor_serial:
        yield ("hand_eye", ("sensor_serial",), f"calibrated with the sensor "
               f"{hand_eye.sensor_serial}; sensor.yaml is of {sensor.serial}")
    if body.calibration_set not in (None, papers.set_id):
        yield ("body", ("calibration_set",), f"registered with the set {body.calibration_set}; "
               f"active is {papers.set_id}: register the body again, or go back to that set")
    if kinematics is not None and kinematics.model != robot.model:
        yield ("kinematics", ("model",), f"estimated for a {kinematics.model}; the cell has a "
               f"{robot.model}")


def _offsets_against_nominals(papers: Papers) -> Iterator[Contradiction]:
    known = {hole.id for hole in papers.holes}
    for index, offset in enumerate(papers.offsets.offsets if papers.offsets else ()):
        if offset.hole not in known:
            yield "offsets", ("offsets", index, "hole"), _unknown_hole(offset.hole, papers)


def _unknown_hole(hole_id: str, papers: Papers) -> str:
    few = ", ".join(hole.id for hole in papers.holes[:6])
    more = ", ..." if len(papers.holes) > 6 else ""
    return f"the hole {hole_id!r} is not among the nominals ({few}{more})"


def check_identity(record: RobotRecord, identity: RobotIdentity,
                   source: str = "hand_eye") -> None:
    """Refuse a robot other than the one that the hand-eye of `source` was calibrated on.

    Raises:
        DocumentError: model, serial, kinematics checksum, TCP offset or payload differ.
    """
    found = identity.tcp_offset
    pairs = [("model", record.model, identity.model, record.model == identity.model),
             ("serial", record.serial, identity.serial, record.serial == identity.serial),
             ("kinematics_checksum", record.kinematics_checksum, identity.kinematics_checksum,
              record.kinematics_checksum in ("", identity.kinematics_checksum)),
             ("tcp_offset", list(record.tcp_offset), list(found),
              np.allclose(record.tcp_offset, found, rtol=0.0, atol=TCP_TOLERANCE)),
             ("payload_kg", record.payload_kg, identity.payload_kg,
              abs(record.payload_kg - identity.payload_kg) <= PAYLOAD_TOLERANCE_KG)]
    for name, expected, came, same in pairs:
        if not same:
            raise DocumentError(f"calibrated on a robot with {name} {expected}; the controller "
                                f"says {came}: activate the set of this robot, or calibrate",
                                source=source, place=f"robot.{name}")
