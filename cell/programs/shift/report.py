"""The report of a shift, gathered from ledger and results and written beside the recordings."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

from cell.archive.files import read_text
from cell.core.documents.shift import ShiftDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.programs.report import write_page
from cell.programs.results import opened
from cell.report.shift import Disk, ShiftFacts, shift_csv, shift_report
from cell.results.booking import Row
from cell.results.database import Database
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.summary import (
    Window,
    calibrations_used,
    newest_seal,
    rank_failing,
    rank_refusals,
)
from cell.results.tables import bypasses, faults, notices, visits

PAUSE_BETWEEN_SHIFTS = 3600.0
"""Seconds without a body that end a shift, where a report is asked for afterwards."""


@dataclass(frozen=True)
class Written:
    """Where a report lies."""

    html: Path
    csv: Path


def write_shift_report(logs: Path, document: ShiftDocument, began: float, ended: float) -> Written:
    """Write the report of what happened from `began` to `ended`.

    Raises:
        RecordingError: it cannot be written.
    """
    with opened(logs) as database:
        facts = gather(database, logs, document, began, ended)
    moment = datetime.fromtimestamp(began, UTC).strftime("%Y-%m-%dT%H%M%SZ")
    stem = logs / f"shift_{document.name}_{moment}"
    return Written(write_page(shift_report(facts), stem.with_name(stem.name + ".html")),
                   write_page(shift_csv(facts), stem.with_name(stem.name + ".csv")))


def write_last_report(logs: Path, file: Path) -> Written:
    """Write the report of the last shift of this file, be it running or over.

    Raises:
        DocumentError: there has been none.
    """
    document = parse(ShiftDocument, read_text(file), str(file))
    with opened(logs) as database:
        times = [row["arrived"] for row in _of_shift(database, document)]
    if not times:
        raise DocumentError("no body has come in a shift of this name", source=str(file))
    return write_shift_report(logs, document, _last_begin(times), time.time())


def gather(database: Database, logs: Path, document: ShiftDocument, began: float,
           ended: float) -> ShiftFacts:
    """Gather what the report says."""
    ledger, window = Ledger(database, document.cell, document.name), Window(document.cell, began,
                                                                            ended)
    measured = list_bodies(database, Filter(since=began, until=ended))
    came = ledger.rows(visits, visits.c.arrived >= began, visits.c.arrived < ended)
    return ShiftFacts(
        document.name, document.cell, began, ended,
        document.takt.seconds if document.takt else None, came,
        ledger.rows(faults, faults.c.at >= began, faults.c.at < ended),
        ledger.rows(bypasses, bypasses.c.since < ended,
                    bypasses.c.ended.is_(None) | (bypasses.c.ended >= began)),
        ledger.rows(notices, notices.c.at >= began, notices.c.at < ended),
        rank_failing(database, window), rank_refusals(database, window),
        calibrations_used(database, window), newest_seal(database, window),
        _disk(logs, measured), any(row["simulated"] for row in measured))


def _disk(logs: Path, measured: list[Row]) -> Disk:
    sizes = [path.stat().st_size for row in measured if (path := logs / row["log"]).exists()]
    return Disk(shutil.disk_usage(logs).free, sum(sizes), len(sizes))


def _of_shift(database: Database, document: ShiftDocument) -> list[Row]:
    return Ledger(database, document.cell, document.name).rows(
        visits, visits.c.shift == document.name)


def _last_begin(times: list[float]) -> float:
    """Find the first body after the last long pause."""
    begin = times[0]
    for before, after in pairwise(times):
        if after - before > PAUSE_BETWEEN_SHIFTS:
            begin = after
    return begin
