"""A shift in a process of its own, to be killed: real line, ledger, recordings; recorded bodies.

    python made_shift_process.py LOGS PORT
"""

import sys
import time
from pathlib import Path

from made_cell import RecordedCell, demo_job, demo_papers

from cell.core.documents.shift import BodyType, LineSettings, ShiftDocument
from cell.line.modbus import ModbusLine
from cell.programs.results import FILE, book_missing
from cell.programs.shift.books import Books
from cell.programs.shift.clock import WatchedClock
from cell.programs.shift.desk import Desk
from cell.programs.shift.machine import Shift
from cell.programs.shift.measuring import Measuring
from cell.results.approvals import approved
from cell.results.database import open_database
from cell.results.ledger import Ledger
from cell.results.query import find_recording

HOLE_SECONDS = 0.05


class Archive:
    def __init__(self, database):
        self.database = database

    def approved(self, hashes):
        return approved(self.database, tuple(hashes))

    def booked(self, recording_id):
        return find_recording(self.database, recording_id)


def run(logs: Path, port: int, plant=lambda body, hole: time.sleep(HOLE_SECONDS),
        deviation=lambda body, hole: 0.1, bodies=None) -> None:
    papers = demo_papers()
    document = ShiftDocument(name="killed", cell=papers.station.name,
                             bodies=(BodyType(type=1, job="demo.yaml"),),
                             line=LineSettings(port=port))
    cell = RecordedCell({"demo.yaml": demo_job(papers)}, logs, deviation, plant, papers)
    database = open_database(logs / FILE)
    with database.transaction() as connection:
        book_missing(connection, logs)
    line = ModbusLine("127.0.0.1", port)
    line.open()
    try:
        with Books(database, None, logs) as books:
            desk = Desk(document, line, Ledger(database, cell.name, document.name),
                        WatchedClock(), lambda board: None)
            Shift(desk, cell, Measuring(desk, cell, books), Archive(database)).run(bodies)
    finally:
        line.close()
        database.close()


if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]))
