"""The report of a shift: a self-contained HTML page, and its bodies as CSV."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import StringIO
from statistics import mean
from typing import Any, TypeAlias

from jinja2 import Environment, PackageLoader, select_autoescape

Row: TypeAlias = dict[str, Any]

COLUMNS = ("sequence", "time_utc", "body_id", "body_type", "kind", "verdict", "trial", "measured",
           "out_of_tolerance", "missing", "worst", "seconds", "state", "recording_id", "reason")
VERDICTS = ("in_tolerance", "out_of_tolerance", "uncertain", "incomplete")


@dataclass(frozen=True)
class Disk:
    """The disk of the recordings: free bytes, and what the bodies of this shift took of it."""

    free: int
    used: int
    bodies: int

    @property
    def bodies_left(self) -> int | None:
        """How many more bodies fit; None where nothing is known of their size."""
        return self.free * self.bodies // self.used if self.used and self.bodies else None


@dataclass(frozen=True)
class ShiftFacts:
    """All that the report says. Rows are those of the ledger and of the results database."""

    name: str
    cell: str
    began: float
    ended: float
    takt: float | None
    visits: Sequence[Row]
    faults: Sequence[Row]
    bypasses: Sequence[Row]
    notices: Sequence[Row]
    failing: Sequence[Row]
    refusals: Sequence[Row]
    calibrations: Sequence[Row]
    seal: str
    disk: Disk
    simulated: bool = False

    @property
    def bodies(self) -> list[Row]:
        """The visits of production bodies, the master's apart."""
        return [visit for visit in self.visits if visit["kind"] != "master"]

    @property
    def masters(self) -> list[Row]:
        """The visits of the master."""
        return [visit for visit in self.visits if visit["kind"] == "master"]

    @property
    def verdicts(self) -> dict[str, int]:
        """How many bodies had each verdict."""
        found = Counter(visit["verdict"] for visit in self.bodies)
        return {verdict: found[verdict] for verdict in VERDICTS}

    @property
    def seconds(self) -> list[float]:
        """What each measured body took, from its announcement to its verdict."""
        return [visit["judged"] - visit["arrived"] for visit in self.bodies
                if visit["judged"] and visit["kind"] == "body"]

    @property
    def mean_seconds(self) -> float | None:
        """The mean of `seconds`."""
        return mean(self.seconds) if self.seconds else None

    @property
    def over_takt(self) -> int:
        """How many bodies took longer than the takt."""
        return sum(seconds > self.takt for seconds in self.seconds) if self.takt else 0


def shift_report(facts: ShiftFacts) -> str:
    """Write the page of one shift."""
    pages = Environment(loader=PackageLoader("cell.report"), autoescape=select_autoescape(["j2"]),
                        trim_blocks=True, lstrip_blocks=True)
    pages.filters.update(utc=utc, words=lambda text: (text or "").replace("_", " "))
    return pages.get_template("shift.html.j2").render(facts=facts)


def shift_csv(facts: ShiftFacts) -> str:
    """Write one line a body, the master's included."""
    stream = StringIO()
    writer = csv.DictWriter(stream, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for visit in facts.visits:
        seconds = visit["judged"] - visit["arrived"] if visit["judged"] else None
        writer.writerow({**visit, "time_utc": utc(visit["arrived"]),
                         "seconds": None if seconds is None else round(seconds, 1)})
    return stream.getvalue()


def utc(moment: float | None) -> str:
    """Write a time as 2026-11-22 12:00:00; empty where there is none."""
    if moment is None:
        return ""
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%d %H:%M:%S")
