"""A shift over a recorded cell, a line that remembers, and a database of its own."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from made_cell import RecordedCell, made_job
from made_line import RememberingLine

from cell.core.documents.shift import BodyType, ShiftDocument
from cell.programs.shift.books import Books
from cell.programs.shift.clock import WatchedClock
from cell.programs.shift.desk import Desk
from cell.programs.shift.machine import Shift
from cell.programs.shift.measuring import Measuring
from cell.results.database import open_database
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.tables import faults, notices, visits


class MadeShift:
    """Everything of one shift, put together by hand."""

    def __init__(self, folder):
        self.folder = folder
        self.document = ShiftDocument(name="early", cell="recorded",
                                      bodies=(BodyType(type=1, job="demo.yaml"),))
        self.cell = RecordedCell({"demo.yaml": made_job(), "master.yaml": made_job("master")})
        self.line, self.clock, self.boards = RememberingLine(), WatchedClock(), []
        self.approved, self.plant, self.patience = False, None, 30.0
        self.database = open_database(folder / "results.sqlite")
        self.ledger = Ledger(self.database, "recorded", "early")
        self.archive = SimpleNamespace(approved=lambda hashes: self.approved, booked=self.booked)

    def change(self, **fields):
        self.document = self.document.model_copy(update=fields)

    def run(self, *orders, bodies=None):
        """Run the shift on these orders, one after the other, then stop."""
        self.line.orders = list(orders)
        with Books(self.database, self.plant, self.folder) as books:
            ledger = replace(self.ledger, mirror=books.mirror)
            desk = Desk(self.document, self.line, ledger, self.clock, self.boards.append)
            self.shift = Shift(desk, self.cell, Measuring(desk, self.cell, books), self.archive)
            self.shift.run(bodies)
            self.settled = books.settle(self.patience)
        return self

    def booked(self, recording_id):
        return next((body for body in self.bodies if body["recording_id"] == recording_id), None)

    @property
    def bodies(self):
        return list_bodies(self.database, Filter())[::-1]

    @property
    def visits(self):
        return self.ledger.rows(visits)

    @property
    def faults(self):
        return self.ledger.rows(faults)

    @property
    def notices(self):
        return [(row["kind"], row["detail"]) for row in self.ledger.rows(notices)]

    @property
    def verdicts(self):
        return [(result.body_id, result.verdict) for result in self.line.results]

    @property
    def states(self):
        seen = [board.state for board in self.boards]
        return [state for state, before in zip(seen, [None, *seen], strict=False)
                if state != before]


@pytest.fixture
def made(tmp_path):
    found = MadeShift(tmp_path)
    yield found
    found.database.close()
