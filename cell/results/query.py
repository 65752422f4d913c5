"""Asking the database: bodies, one body, the trend of one axis, everything as a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, select

from cell.results.booking import Row
from cell.results.database import Database
from cell.results.tables import axes, bodies, features


@dataclass(frozen=True)
class Filter:
    """Which bodies are wanted: None and empty mean any. Times are seconds since 1970 (UTC)."""

    since: float | None = None
    until: float | None = None
    job: str = ""
    verdict: str = ""
    body_id: str = ""
    production_only: bool = False
    last: int | None = None


@dataclass(frozen=True)
class Point:
    """One body's value in a trend."""

    body_id: str
    started: float
    deviation: float | None
    uncertainty: float | None
    verdict: str | None


def list_bodies(database: Database, wanted: Filter) -> list[Row]:
    """List bodies, the latest first."""
    with database.transaction() as connection:
        query = _narrowed(select(bodies), wanted).order_by(bodies.c.started.desc(),
                                                           bodies.c.key.desc())
        return [dict(row) for row in connection.execute(query.limit(wanted.last)).mappings()]


def show_body(database: Database, name: str) -> tuple[Row, list[Row]] | None:
    """Find the latest recording of a body (or a recording, by its id) and all its axes."""
    with database.transaction() as connection:
        body = connection.execute(
            select(bodies).where((bodies.c.body_id == name) | (bodies.c.recording_id == name))
            .order_by(bodies.c.started.desc())).mappings().first()
        if body is None:
            return None
        rows = connection.execute(_axes_of_features().where(features.c.body == body["key"])
                                  .order_by(features.c.position, axes.c.axis)).mappings()
        return dict(body), [dict(row) for row in rows]


def find_recording(database: Database, recording_id: str) -> Row | None:
    """Find the body of a recording."""
    with database.transaction() as connection:
        found = connection.execute(select(bodies).where(bodies.c.recording_id == recording_id))
        row = found.mappings().first()
        return dict(row) if row else None


def trend(database: Database, feature: str, axis: str, wanted: Filter) -> list[Point]:
    """Follow one axis of one feature over the bodies, the earliest first."""
    query = (select(bodies.c.body_id, bodies.c.started, axes.c.deviation, axes.c.uncertainty,
                    axes.c.verdict)
             .join(axes, axes.c.body == bodies.c.key)
             .where(axes.c.feature == feature, axes.c.axis == axis))
    with database.transaction() as connection:
        rows = connection.execute(_narrowed(query, wanted).order_by(bodies.c.started.desc())
                                  .limit(wanted.last)).all()
    return [Point(*row) for row in reversed(rows)]


def export_rows(database: Database, wanted: Filter) -> Iterator[Row]:
    """Give every axis of every body as one row a line, the earliest body first."""
    named = [bodies.c[name] for name in ("body_id", "recording_id", "started", "job", "cell",
                                         "set_id", "trial", "simulated", "status")]
    query = (_axes_of_features().add_columns(*named, bodies.c.verdict.label("body_verdict"))
             .join(bodies, bodies.c.key == features.c.body))
    ordered = _narrowed(query, wanted).order_by(bodies.c.started, bodies.c.key,
                                                features.c.position, axes.c.axis)
    with database.transaction() as connection:
        for row in connection.execution_options(yield_per=5000).execute(ordered).mappings():
            yield dict(row)


def _axes_of_features() -> Select[Any]:
    """Join features with their axes; a hole that was not measured is a row without numbers."""
    return (select(features.c.feature, features.c.verdict.label("feature_verdict"),
                   features.c.reason, axes.c.axis, axes.c.nominal, axes.c.tolerance,
                   axes.c.measured, axes.c.deviation, axes.c.uncertainty, axes.c.bias,
                   axes.c.verdict)
            .select_from(features).outerjoin(axes, (axes.c.body == features.c.body)
                                             & (axes.c.feature == features.c.feature)))


def _narrowed(query: Select[Any], wanted: Filter) -> Select[Any]:
    conditions = [
        (wanted.since is not None, bodies.c.started >= (wanted.since or 0.0)),
        (wanted.until is not None, bodies.c.started < (wanted.until or 0.0)),
        (bool(wanted.job), bodies.c.job == wanted.job),
        (bool(wanted.verdict), bodies.c.verdict == wanted.verdict),
        (bool(wanted.body_id), bodies.c.body_id == wanted.body_id),
        (wanted.production_only, bodies.c.trial.is_(False)),
    ]
    return query.where(*(condition for asked, condition in conditions if asked))
