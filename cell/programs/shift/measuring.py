"""One body of a shift: measured, broken off or continued, judged, booked and driven away from."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

from cell.core.documents.record import Stop
from cell.core.documents.result import BodyResult
from cell.core.errors import CellError, DeviceError, RecordingError
from cell.programs.shift.books import Books
from cell.programs.shift.desk import Desk
from cell.programs.shift.faults import fault_of
from cell.programs.shift.standing import stand
from cell.programs.shift.takt import TaktGuard
from cell.programs.shift.watch import BodyWatch
from cell.programs.shift.work import Begun, Cell, PreparedJob
from cell.results.booking import Booking, Row, body_rows, book


class BodyAbortedError(Exception):
    """Break the body off: the line, or a person, said so."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a body: its result, None where there is none, and a remark."""

    result: BodyResult | None
    reason: str


class Measuring:
    """Measures the bodies of a shift, one at a time."""

    def __init__(self, desk: Desk, cell: Cell, books: Books) -> None:
        self._desk, self._cell, self._books = desk, cell, books
        self._takt = TaktGuard(desk.document.takt) if desk.document.takt else None
        self._guard: TaktGuard | None = None
        self._begun: Begun | None = None

    def measure(self, visit: Row, job: PreparedJob) -> tuple[Row, Outcome]:
        """Measure a body and book what came out; the arm may still stand over it afterwards."""
        self._guard = self._guard_of(visit)
        self._desk.update(state="measuring", busy=True, clear=False, hole=0, holes=len(job.holes),
                          body_id=visit["body_id"], body_type=visit["body_type"], instruction="",
                          trial=visit["trial"])
        self._begun = self._begin(visit, job)
        if self._begun is None:
            return visit, Outcome(None, "its recording could not be begun")
        visit = self._desk.ledger.update_visit(
            visit, recording_id=self._begun.start.recording_id)
        stop = self._measure(visit, job, self._begun)
        if stop is None:
            return visit, Outcome(None, "its recording could not be written")
        self._book(job, self._begun, stop)
        return visit, Outcome(stop.result, stop.reason)

    @property
    def trouble(self) -> str:
        """What is wrong with the books at the moment, or nothing."""
        return self._books.trouble

    def leave(self, visit: Row) -> None:
        """Drive the arm out of the body's way, however often it takes."""
        while self._begun is not None and not self._desk.interrupted:
            try:
                self._begun.inspection.go_home()
                self._begun = None
            except DeviceError as error:
                stand(self._desk, self._cell, fault_of(error), str(error), visit)
                if self._desk.stopping:
                    break
        self._desk.update(busy=False, clear=self._begun is None)
        self._begun = None

    def _guard_of(self, visit: Row) -> TaktGuard | None:
        """Start the takt of a body; a master is measured whole, whatever it takes."""
        if self._takt is None or visit["kind"] == "master":
            return None
        self._takt.begin(time.monotonic())
        return self._takt

    def _begin(self, visit: Row, job: PreparedJob) -> Begun | None:
        while True:
            try:
                return self._cell.begin(job, visit["body_id"], trial=visit["trial"])
            except CellError as error:
                if not stand(self._desk, self._cell, fault_of(error), str(error), visit):
                    return None

    def _measure(self, visit: Row, job: PreparedJob, begun: Begun) -> Stop | None:
        inspection = begun.inspection
        watch = BodyWatch(job, self._desk.document.faults, self._guard, self._look)
        while True:
            try:
                inspection.measure_remaining(
                    lambda hole: watch.wanted(hole, inspection.records))
                watch.check(inspection.records)
                return inspection.finish("complete", watch.remark)
            except BodyAbortedError as aborted:
                return inspection.finish("aborted", str(aborted))  # between holes it stands
            except KeyboardInterrupt:
                self._desk.interrupt()
                return inspection.abandon("interrupted", "stopped by a person")
            except DeviceError as error:
                if not stand(self._desk, self._cell, fault_of(error), str(error), visit):
                    return inspection.abandon("fault", str(error))
                watch.resume()
            except RecordingError as error:
                self._give_up(begun, error, visit)
                return None

    def _give_up(self, begun: Begun, error: RecordingError, visit: Row) -> None:
        """Close a recording that cannot be written: what was written before stays."""
        self._cell.make_safe()
        with suppress(RecordingError):
            begun.inspection.abandon("fault", str(error))
        stand(self._desk, self._cell, fault_of(error), str(error), visit)

    def _look(self, done: int) -> None:
        left = int(self._guard.seconds_left(time.monotonic())) if self._guard else 0
        self._desk.update(hole=done, seconds_left=left)
        order = self._desk.look(0.0)
        if order is None:
            return
        self._desk.line.answer(order, "" if order.command == "abort" else "not_ready")
        if order.command == "abort":
            raise BodyAbortedError(order.reason or "aborted by the line")

    def _book(self, job: PreparedJob, begun: Begun, stop: Stop) -> None:
        """Hand the body to the books; they are written while the line goes on."""
        log = f"{begun.start.recording_id}.rrd"
        rows = body_rows(Booking(begun.start, stop, job.name, self._cell.name, log, begun.seal()))
        self._books.submit(lambda connection: book(connection, rows))
