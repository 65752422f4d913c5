"""The results database as a program uses it: opened, made again from the recordings, exported."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from sqlalchemy import Connection, select

from cell.archive.logs import PICTURE
from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.errors import CellError, DocumentError
from cell.metrology.judge.decide import judge_run
from cell.recording.integrity import COPIES
from cell.recording.pages import read_pages, without_images
from cell.results.booking import BodyRows, Booking, Row, body_rows, book
from cell.results.database import (
    Database,
    connect,
    open_database,
    read_database,
    recreate_results,
)
from cell.results.query import Filter, list_bodies
from cell.results.tables import bodies

FILE = "results.sqlite"

COLUMNS = ("body_id", "recording_id", "time_utc", "job", "cell", "set_id", "trial", "simulated",
           "status", "body_verdict", "feature", "feature_verdict", "reason", "axis", "nominal",
           "measured", "deviation", "tolerance", "uncertainty", "bias", "verdict")


@contextmanager
def opened(logs: Path, url: str | None = None, *, any_schema: bool = False) -> Iterator[Database]:
    """Open the database at `url`, or the cell's own beside its recordings; close it afterwards.

    Where the cell's own cannot be written it is opened for reading: an auditor has a copy.
    """
    if url is None and not logs.is_dir():
        raise DocumentError("there is no such folder of recordings", source=str(logs))
    if url is None and not any_schema and not _is_writable(logs):
        database = read_database(logs / FILE)
    else:
        database = (connect if any_schema else open_database)(url or logs / FILE)
    try:
        yield database
    finally:
        database.close()


def _is_writable(logs: Path) -> bool:
    """SQLite writes its file, and more files beside it, even to read."""
    return all(os.access(path, os.W_OK) for path in (logs, logs / FILE) if path.exists())


def count_unbooked(database: Database, logs: Path) -> int:
    """Count the recordings of a folder that have no row: those of `cell run`, until a rebuild."""
    with database.transaction() as connection:
        return len({_original(log.name) for log in _unbooked(connection, logs)})


def _unbooked(connection: Connection, logs: Path) -> list[Path]:
    known = {_original(log) for log in connection.execute(select(bodies.c.log)).scalars()}
    return [log for log in sorted(logs.glob("*.rrd"))
            if _original(log.name) not in known and not log.name.endswith(PICTURE)]


def _original(log: str) -> str:
    """Name the recording that a repaired or pruned copy was made from: one body, one row."""
    stem = log.removesuffix(".rrd")
    for copied in COPIES:
        stem = stem.removesuffix(f".{copied}")
    return stem


def rebuild(database: Database, logs: Path, watch: Callable[[int, int], None]) -> list[str]:
    """Make the rows of all recordings again, and return what could not be read."""
    files = sorted(logs.glob("*.rrd"))
    with database.transaction() as connection:
        recreate_results(connection)
    troubles = []
    for count, log in enumerate(files, start=1):
        try:
            rows = read_rows(log)
        except CellError as error:
            troubles.append(str(error))
            continue
        with database.transaction() as connection:
            book(connection, rows)
        watch(count, len(files))
    return troubles


def book_missing(connection: Connection, logs: Path) -> None:
    """Book the recordings that a killed program had no time to book."""
    for log in _unbooked(connection, logs):
        try:
            rows = read_rows(log)
        except CellError:
            continue  # `cell results rebuild` names it
        book(connection, rows)


def read_rows(log: Path) -> BodyRows:
    """Turn a recording into its rows. One that died is judged by the holes that it holds.

    Raises:
        DocumentError: it is no recording, its papers are not whole, or it is altered.
    """
    start, records, stop, chain = _papers_of(log)
    papers = Papers.parse(start.papers, start.set_id)
    left = None if stop else judge_run(papers, start, records)
    return body_rows(Booking(start, stop, papers.job.name, papers.station.name, log.name, chain,
                             left))


def refuse_nothing(database: Database, wanted: Filter) -> None:
    """Refuse a filter that no body matches: an empty answer would read as if all was well.

    Raises:
        DocumentError: says what there is.
    """
    if replace(wanted, last=None) == Filter() or list_bodies(database, replace(wanted, last=1)):
        return
    known = list_bodies(database, Filter())
    raise DocumentError("no body matches; the database holds " + (
        f"{len(known)}, from {utc(known[-1]['started'])} to {utc(known[0]['started'])}, of "
        + ", ".join(sorted({row["job"] for row in known})) if known else "none yet"))


def write_csv(rows: Iterable[Row], stream: TextIO) -> int:
    """Write one line an axis; returns how many. Times are UTC, ISO 8601."""
    writer = csv.DictWriter(stream, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    count = 0
    for row in rows:
        writer.writerow({**row, "time_utc": utc(row["started"])})
        count += 1
    return count


def utc(moment: float | None) -> str:
    """Write a time as 2026-11-22T12:00:00Z; empty where there is none."""
    if moment is None:
        return ""
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _papers_of(log: Path) -> tuple[Start, list[HoleRecord], Stop | None, str]:
    """Gather the records of a recording, without its images, and the head of its chain."""
    start = stop = None
    records, chain = [], ""
    for page in read_pages(log):
        if page.faults:
            raise DocumentError(f"is not as it was recorded: {'; '.join(page.faults)}",
                                source=str(log))
        chain = page.chain
        if isinstance(page.record, Start):
            start = page.record
        elif isinstance(page.record, HoleRecord):
            records.append(without_images(page.record))
        elif isinstance(page.record, Stop):
            stop = page.record
    assert start is not None  # `read_pages` sees to it
    return start, records, stop, chain
