"""What a shift report asks of the database: rankings and the calibrations in use."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, func, select

from cell.results.booking import Row
from cell.results.database import Database
from cell.results.tables import axes, bodies, calibrations, features, visits


@dataclass(frozen=True)
class Window:
    """The bodies of one cell that were begun from `since` on and before `until`."""

    cell: str
    since: float
    until: float

    @property
    def condition(self) -> ColumnElement[bool]:
        """The same as a condition on `bodies`."""
        return and_(bodies.c.cell == self.cell, bodies.c.started >= self.since,
                    bodies.c.started < self.until)

    @property
    def without_masters(self) -> ColumnElement[bool]:
        """The same, leaving out the master: it is compared with its CMM, not with the drawing."""
        masters = select(visits.c.recording_id).where(visits.c.kind == "master",
                                                      visits.c.recording_id.is_not(None))
        return and_(self.condition, bodies.c.recording_id.not_in(masters))


def rank_failing(database: Database, window: Window) -> list[Row]:
    """Rank the axes out of tolerance, the master's apart: how often, and how far at worst."""
    count = func.count()
    query = (select(axes.c.feature, axes.c.axis, count.label("times"),
                    func.max(func.abs(axes.c.deviation)).label("worst"),
                    func.avg(axes.c.deviation).label("mean"))
             .join(bodies, bodies.c.key == axes.c.body)
             .where(window.without_masters, axes.c.verdict == "out_of_tolerance")
             .group_by(axes.c.feature, axes.c.axis).order_by(count.desc(), axes.c.feature))
    with database.transaction() as connection:
        return [dict(row) for row in connection.execute(query).mappings()]


def rank_refusals(database: Database, window: Window) -> list[Row]:
    """Rank the holes that were not measured, the master's apart, with the reason."""
    count = func.count()
    query = (select(features.c.feature, features.c.reason, count.label("times"))
             .join(bodies, bodies.c.key == features.c.body)
             .where(window.without_masters, features.c.verdict == "not_measured")
             .group_by(features.c.feature, features.c.reason)
             .order_by(count.desc(), features.c.feature))
    with database.transaction() as connection:
        return [dict(row) for row in connection.execute(query).mappings()]


def calibrations_used(database: Database, window: Window) -> list[Row]:
    """List the calibrations that bodies were measured with."""
    query = (select(calibrations, func.count().label("bodies"))
             .join(bodies, bodies.c.calibration == calibrations.c.hash)
             .where(window.condition).group_by(*calibrations.columns).order_by(calibrations.c.first_used))
    with database.transaction() as connection:
        return [dict(row) for row in connection.execute(query).mappings()]


def newest_seal(database: Database, window: Window) -> str:
    """Give the head of the newest recording's chain: kept elsewhere, it shows what was removed."""
    query = (select(bodies.c.seal).where(window.condition)
             .order_by(bodies.c.started.desc()).limit(1))
    with database.transaction() as connection:
        return connection.execute(query).scalar() or ""
