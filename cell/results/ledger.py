"""The ledger of a cell: what its line and its people did, in one small transaction each.

The state of a shift lives here and not in memory. Each entry is written before the cell acts on
it: a body that was announced is in the ledger before the line hears that it was accepted.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from sqlalchemy import ColumnElement, Connection, Table, and_, delete, func, insert, select

from cell.results.booking import Row
from cell.results.database import Database
from cell.results.tables import bypasses, faults, notices, visits

LEDGER = (visits, faults, bypasses, notices)

VisitKind: TypeAlias = Literal["body", "master", "bypassed"]
VisitState: TypeAlias = Literal["measuring", "judged", "released", "interrupted"]
Mirror: TypeAlias = Callable[[Callable[[Connection], None]], None]


@dataclass(frozen=True)
class Ledger:
    """The ledger of one cell during one shift.

    `mirror` is handed each entry a second time, for a plant's database elsewhere.
    """

    database: Database
    cell: str
    shift: str
    mirror: Mirror | None = None

    def put(self, table: Table, row: Row) -> None:
        """Write one row in place of the one with its key, and see it on the disk."""
        with self.database.transaction() as connection:
            replace_row(connection, table, row)
        self._tell_mirror(table, row)

    def arrive(self, row: Row) -> Row:
        """Book an announced body under the next sequence number."""
        with self.database.transaction() as connection:
            last = connection.execute(select(func.max(visits.c.sequence))
                                      .where(visits.c.cell == self.cell)).scalar()
            entry = {"cell": self.cell, "shift": self.shift, "sequence": (last or 0) + 1,
                     "state": "measuring", "recording_id": None, "verdict": None, "measured": 0,
                     "out_of_tolerance": 0, "missing": 0, "worst": None, "judged": None,
                     "released": None, "reason": "", **row}
            connection.execute(insert(visits), entry)
        self._tell_mirror(visits, entry)
        return entry

    def update_visit(self, visit: Row, **changes: object) -> Row:
        """Write a visit with some of its fields changed, and return it."""
        changed = {**visit, **changes}
        self.put(visits, changed)
        return changed

    def note(self, kind: str, detail: str, at: float) -> None:
        """Keep something that an auditor should know."""
        self.put(notices, self._signed(at=at, kind=kind, detail=detail))

    def open_fault(self, state: str, code: int, detail: str, at: float,
                   sequence: int | None = None) -> Row:
        """Record that the cell came to stand in a fault state."""
        row = self._signed(at=at, state=state, code=code, detail=detail, sequence=sequence,
                           recovered_at=None, recovered_by=None)
        self.put(faults, row)
        return row

    def close_fault(self, fault: Row, by: str, at: float) -> None:
        """Record who confirmed that the cause is gone."""
        self.put(faults, {**fault, "recovered_at": at, "recovered_by": by})

    def open_bypass(self, by: str, reason: str, since: float, until: float) -> Row:
        """Record who lets bodies pass unmeasured, why, since when and until when at most."""
        row = self._signed(requested_by=by, reason=reason, since=since, until=until, ended=None,
                           ended_by=None)
        self.put(bypasses, row)
        return row

    def close_bypass(self, bypass: Row, by: str, at: float) -> None:
        """Record that bodies are measured again, and by whose word."""
        self.put(bypasses, {**bypass, "ended": at, "ended_by": by})

    def open_visits(self) -> list[Row]:
        """Find the bodies whose result the line has not acknowledged, in order."""
        return self.rows(visits, visits.c.state != "released")

    def current_bypass(self) -> Row | None:
        """Find the bypass that nobody has ended, if there is one."""
        return next(iter(self.rows(bypasses, bypasses.c.ended.is_(None))), None)

    def last_time(self) -> float | None:
        """Give the latest time in the ledger: a clock that shows less has stepped back."""
        with self.database.transaction() as connection:
            times = [connection.execute(select(func.max(column))
                                        .where(column.table.c.cell == self.cell)).scalar()
                     for column in (visits.c.arrived, visits.c.judged, visits.c.released,
                                    faults.c.at, notices.c.at)]
        return max((time for time in times if time is not None), default=None)

    def rows(self, table: Table, *conditions: ColumnElement[bool]) -> list[Row]:
        """Give the rows of this cell, in the order in which they were written."""
        order = table.c[{"visits": "sequence", "bypasses": "since"}.get(table.name, "at")]
        with self.database.transaction() as connection:
            found = connection.execute(
                select(table).where(table.c.cell == self.cell, *conditions).order_by(order))
            return [dict(row) for row in found.mappings()]

    def repeat_to_mirror(self) -> None:
        """Hand the mirror every entry again: some may have been lost with a killed program."""
        for table in LEDGER if self.mirror else ():
            for row in self.rows(table):
                self._tell_mirror(table, row)

    def _tell_mirror(self, table: Table, row: Row) -> None:
        if self.mirror is not None:
            self.mirror(lambda connection: replace_row(connection, table, row))

    def _signed(self, **fields: object) -> Row:
        return {"id": uuid.uuid4().hex, "cell": self.cell, "shift": self.shift, **fields}


def replace_row(connection: Connection, table: Table, row: Row) -> None:
    """Write `row` in place of the one with the same primary key."""
    key = and_(*(column == row[column.name] for column in table.primary_key))
    connection.execute(delete(table).where(key))
    connection.execute(insert(table), row)
