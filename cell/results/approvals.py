"""Approvals: whose word lets papers give production results. What is not approved is a TRIAL."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import func, select

from cell.results.booking import Row
from cell.results.database import Database
from cell.results.ledger import replace_row
from cell.results.tables import approvals


def approve(database: Database, rows: Sequence[Row]) -> None:
    """Record approvals: `hash, kind, name, approved_by, approved_at, note`."""
    with database.transaction() as connection:
        for row in rows:
            replace_row(connection, approvals, {"withdrawn_at": None, **row})


def withdraw(database: Database, hashes: Sequence[str], at: float) -> int:
    """End approvals; the record stays. Returns how many were in force."""
    with database.transaction() as connection:
        return connection.execute(
            approvals.update().where(approvals.c.hash.in_(hashes),
                                     approvals.c.withdrawn_at.is_(None))
            .values(withdrawn_at=at)).rowcount


def approved(database: Database, hashes: Sequence[str]) -> bool:
    """Tell whether all of `hashes` are approved and not withdrawn."""
    with database.transaction() as connection:
        found = connection.execute(
            select(func.count()).select_from(approvals)
            .where(approvals.c.hash.in_(hashes), approvals.c.withdrawn_at.is_(None))).scalar_one()
    return found == len(set(hashes))
