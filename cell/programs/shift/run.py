"""`cell shift`: a shift put together from its file, and run until somebody says stop."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from pathlib import Path

from cell.archive.files import read_text
from cell.archive.logs import check_logs
from cell.core.documents.shift import ShiftDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.core.ports import Line
from cell.line.manual import Keyboard, LineWithKeyboard, ManualLine
from cell.line.modbus import ModbusLine
from cell.line.virtual_plc import VirtualBody, VirtualPlc
from cell.programs.inspection import Prepared, prepare
from cell.programs.results import FILE, book_missing
from cell.programs.shift.board import Board
from cell.programs.shift.books import Books
from cell.programs.shift.clock import WatchedClock
from cell.programs.shift.desk import Desk
from cell.programs.shift.machine import Shift
from cell.programs.shift.measuring import Measuring
from cell.programs.shift.station_cell import StationCell
from cell.programs.station import Station, open_station
from cell.recording.live import LiveView
from cell.recording.room import check_recordable
from cell.results.approvals import approved
from cell.results.booking import Row
from cell.results.database import Database, open_database
from cell.results.ledger import Ledger
from cell.results.query import find_recording

UNKNOWN_TYPE = 65535
MASTER = "MASTER"


@dataclass(frozen=True)
class ShiftRequest:
    """What `cell shift` was asked for. `typed` are the lines of the keyboard, None without one."""

    file: Path
    logs: Path = Path("logs")
    simulate: bool = False
    bodies: int | None = None
    speed: float = 1.0
    live: bool = False
    typed: Iterable[str] | None = None


@dataclass(frozen=True)
class ShiftDone:
    """What became of a shift: the bodies that passed, whether all are booked, and whether a person
    broke it off at the terminal.
    """

    document: ShiftDocument
    began: float
    ended: float
    bodies: int
    all_booked: bool
    interrupted: bool = False


def run_shift(request: ShiftRequest, show: Callable[[Board], None],
              tell: Callable[[str], None]) -> ShiftDone:
    """Run a shift until the line or a person says stop.

    Everything that can be known before anything moves is checked first.

    Raises:
        DocumentError: the shift, a job, a calibration or an option is wrong; nothing moved.
        DeviceError: the station or the line could not be opened.
        DatabaseError: the cell's own database cannot be used.
    """
    document, jobs = read_shift(request.file)
    _check_options(request, jobs)
    check_logs(request.logs)
    check_recordable(request.logs)
    with ExitStack() as closing:
        database = open_database(request.logs / FILE)
        closing.callback(database.close)
        with database.transaction() as connection:
            book_missing(connection, request.logs)
        books = closing.enter_context(Books(database, document.results, request.logs))
        station = _open_station(jobs, request, closing)
        line = _open_line(document, request, station, tell, closing)
        clock = WatchedClock()
        ledger = Ledger(database, document.cell, document.name, books.mirror)
        ledger.repeat_to_mirror()
        desk = Desk(document, line, ledger, clock, show)
        live = closing.enter_context(LiveView()) if request.live else None
        cell = StationCell(station, jobs, request.logs, live)
        began = clock.now()
        shift = Shift(desk, cell, Measuring(desk, cell, books), _Archive(database))
        shift.run(request.bodies)
        return ShiftDone(document, began, clock.now(), shift.done, books.settle(),
                         desk.interrupted)


def read_shift(file: Path) -> tuple[ShiftDocument, dict[str, Prepared]]:
    """Read a shift's file and prepare its jobs, which lie beside it.

    Raises:
        DocumentError: the file, a job, or what a job stands on is wrong.
    """
    document = parse(ShiftDocument, read_text(file), str(file))
    names = [body.job for body in document.bodies]
    names += [document.master.job] if document.master else []
    return document, {name: prepare(file.parent / name, document.cell) for name in names}


@dataclass(frozen=True)
class _Archive:
    """What the cell's own database says of approvals and recordings."""

    database: Database

    def approved(self, hashes: Collection[str]) -> bool:
        return approved(self.database, tuple(hashes))

    def booked(self, recording_id: str) -> Row | None:
        return find_recording(self.database, recording_id)


def _check_options(request: ShiftRequest, jobs: dict[str, Prepared]) -> None:
    station = next(iter(jobs.values())).papers.station
    if request.simulate and station.camera.driver != "sim":
        raise DocumentError("--simulate is for simulated cells: nobody brings virtual bodies to a "
                            "real one", source=f"cell {station.name}")


def _open_station(jobs: dict[str, Prepared], request: ShiftRequest,
                  closing: ExitStack) -> Station:
    first = next(iter(jobs.values()))
    station = closing.enter_context(
        open_station(first.papers.station, first.folder, request.speed))
    for prepared in jobs.values():
        prepared.check_devices(station)
    return station


def _open_line(document: ShiftDocument, request: ShiftRequest, station: Station,
               tell: Callable[[str], None], closing: ExitStack) -> Line:
    settings = document.line
    keyboard = None if request.typed is None else Keyboard(request.typed, tell)
    if settings.driver == "manual" and not request.simulate:
        line: Line = ManualLine(keyboard or Keyboard((), tell), tell)
        line.open()
        return line
    modbus = ModbusLine(settings.address, settings.port, settings.patience_s)
    line = modbus if keyboard is None else LineWithKeyboard(modbus, keyboard)
    line.open()
    closing.callback(line.close)
    if request.simulate:
        plc = VirtualPlc(modbus.endpoint, _virtual_bodies(document, request.bodies),
                         _master(document), partial(_place, station, document),
                         document.simulation.repair_s)
        plc.start()
        closing.callback(plc.stop)
    return line


def _virtual_bodies(document: ShiftDocument, bodies: int | None) -> Iterator[VirtualBody]:
    """Bring the types in turn; the number on each body is that of the body shop."""
    known, rules = [body.type for body in document.bodies], document.simulation
    for number in islice(count(rules.first), bodies):
        if rules.unknown_every and number % rules.unknown_every == 0:
            yield VirtualBody(f"STRANGER{number:06d}", UNKNOWN_TYPE)
        yield VirtualBody(f"BODY{number:06d}", known[number % len(known)])


def _master(document: ShiftDocument) -> VirtualBody | None:
    return VirtualBody(MASTER, document.master.type) if document.master else None


def _place(station: Station, document: ShiftDocument, body: VirtualBody) -> None:
    """Put a virtual body on the station."""
    assert station.world is not None
    if document.is_master(body.body_type):
        station.world.deliver_master()
    elif body.body_type != UNKNOWN_TYPE:
        station.world.deliver_number(int(body.body_id.removeprefix("BODY")))
