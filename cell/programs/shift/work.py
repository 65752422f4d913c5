"""What a shift asks of its cell, so that it can be tried on recorded bodies as well."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from cell.core.documents.nominals import Hole
from cell.core.documents.record import HoleRecord, Start, Status, Stop
from cell.core.documents.result import BodyResult


@dataclass(frozen=True, eq=False)
class PreparedJob:
    """A job that the cell is ready to run: its holes in order, its datums, the approvals needed.

    `hashes` maps each kind of paper (`job`, `calibration`, `cell`) to the hash of its texts.
    """

    name: str
    holes: tuple[Hole, ...]
    datums: frozenset[str]
    hashes: Mapping[str, str]


class Inspection(Protocol):
    """One body under measurement: broken off at any hole, and continued where it stopped."""

    @property
    def records(self) -> Sequence[HoleRecord]:
        """The holes done so far, in order."""

    @property
    def result(self) -> BodyResult:
        """The judgement of what has been measured until now."""

    def measure_remaining(self, wanted: Callable[[Hole], bool]) -> None:
        """Measure every hole not yet done. Raises `DeviceError`, `RecordingError`."""

    def go_home(self) -> None:
        """Drive the arm out of the way of the next body."""

    def finish(self, status: Status, reason: str = "") -> Stop:
        """Judge the body and close its recording."""

    def abandon(self, status: Status, reason: str) -> Stop:
        """Make the cell safe and close the recording with what there is."""


@dataclass(frozen=True, eq=False)
class Begun:
    """A body whose recording has been opened."""

    start: Start
    inspection: Inspection
    seal: Callable[[], str]


class Cell(Protocol):
    """A cell with its devices open and the jobs of the shift prepared."""

    @property
    def name(self) -> str:
        """The cell's name."""

    @property
    def jobs(self) -> Mapping[str, PreparedJob]:
        """The jobs by the names that the shift's file has for them."""

    def begin(self, job: PreparedJob, body_id: str, *, trial: bool) -> Begun:
        """Open the recording of a body. Raises `DocumentError` or `RecordingError`."""

    def go_home(self) -> None:
        """Drive the arm out of the bodies' way from wherever it stands. Raises `DeviceError`."""

    def make_safe(self) -> None:
        """Lights off, arm at rest. Never raises."""

    def recover(self) -> None:
        """Reach the devices again after a person has removed a cause. Raises `DeviceError`."""
