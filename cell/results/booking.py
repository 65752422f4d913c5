"""Booking a body: from the papers of its recording to rows, the same live and on a rebuild."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Any, TypeAlias

from sqlalchemy import Connection, delete, insert, select

from cell.core.documents.record import Start, Stop
from cell.core.documents.result import BodyResult, Feature
from cell.results.tables import axes, bodies, calibrations, features

Row: TypeAlias = dict[str, Any]

CALIBRATION_PAPERS = ("sensor", "hand_eye", "body", "kinematics", "offsets")


@dataclass(frozen=True, eq=False)
class Booking:
    """One recording, as it is booked. `seal` is the head of its chain, `log` its file's name;
    `stop` is None where the run died; `left` is then what can be said of the holes it left.
    """

    start: Start
    stop: Stop | None
    job: str
    cell: str
    log: str
    seal: str
    left: BodyResult | None = None

    @property
    def result(self) -> BodyResult | None:
        """The judgement of the body."""
        return self.stop.result if self.stop else self.left


def calibration_hash(start: Start) -> str:
    """Hash the papers of the calibration that a run was made with."""
    return hash_texts({name: start.papers[name] for name in CALIBRATION_PAPERS
                       if name in start.papers})


def hash_texts(texts: dict[str, str]) -> str:
    """Hash named texts, in any order, so that no text can pass for another."""
    plain = json.dumps(sorted(texts.items()), ensure_ascii=False)
    return hashlib.sha256(plain.encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class BodyRows:
    """A recording as rows: of `bodies`, and of `features` and `axes` without their key."""

    body: Row
    features: list[Row]
    axes: list[Row]


def body_rows(booking: Booking) -> BodyRows:
    """Turn a recording into its rows."""
    judged = booking.result.features if booking.result else ()
    return BodyRows(_body_row(booking),
                    [_feature_row(position, one) for position, one in enumerate(judged)],
                    [row for one in judged for row in _axis_rows(one)])


def book(connection: Connection, rows: BodyRows) -> None:
    """Write one recording's rows in place of any that it had: booking twice changes nothing."""
    _book_calibration(connection, rows.body)
    connection.execute(delete(bodies).where(
        bodies.c.recording_id == rows.body["recording_id"]))
    key = connection.execute(insert(bodies).returning(bodies.c.key), rows.body).scalar_one()
    for table, children in ((features, rows.features), (axes, rows.axes)):
        if children:
            connection.execute(insert(table), [{"body": key, **row} for row in children])


def _book_calibration(connection: Connection, body: Row) -> None:
    known = calibrations.c.hash == body["calibration"]
    if not connection.execute(select(calibrations.c.hash).where(known)).first():
        connection.execute(insert(calibrations).values(
            hash=body["calibration"], cell=body["cell"], set_id=body["set_id"],
            first_used=body["started"]))


def _body_row(booking: Booking) -> Row:
    start, stop, result = booking.start, booking.stop, booking.result
    return {
        "recording_id": start.recording_id, "body_id": start.body_id, "job": booking.job,
        "cell": booking.cell, "set_id": start.set_id, "calibration": calibration_hash(start),
        "started": start.started, "finished": stop.finished if stop else None,
        "status": stop.status if stop else "died",
        "verdict": result.verdict if result else "incomplete",
        "trial": start.trial, "simulated": start.simulated,
        "reason": stop.reason if stop else "the recording has no stop record",
        "log": booking.log, "seal": booking.seal,
        "alignment": json.dumps(result.alignment if result else {}, default=_plain),
        **counts(result)}


def counts(result: BodyResult | None) -> Row:
    """Count the features measured, out of tolerance and missing, and find the worst deviation."""
    judged = result.features if result else ()
    deviations = [abs(value) for feature in judged for value in (feature.deviation or {}).values()]
    missing = sum(feature.verdict == "not_measured" for feature in judged)
    return {"measured": len(judged) - missing, "missing": missing,
            "out_of_tolerance": sum(feature.verdict == "out_of_tolerance" for feature in judged),
            "worst": max(deviations, default=None)}


def _feature_row(position: int, feature: Feature) -> Row:
    return {"feature": feature.id, "position": position, "verdict": feature.verdict,
            "reason": feature.reason, "detail": getattr(feature.outcome, "detail", None),
            "in_plane": feature.in_plane, "along_normal": feature.along_normal,
            "true_position": feature.true_position}


def _axis_rows(feature: Feature) -> list[Row]:
    named = [axis for axis in "xyzd" if axis in (feature.measured or {}) or axis in feature.nominal]
    return [{"feature": feature.id, "axis": axis, "nominal": feature.nominal.get(axis),
             "tolerance": feature.tolerance.get(axis),
             "measured": (feature.measured or {}).get(axis),
             "deviation": (feature.deviation or {}).get(axis),
             "uncertainty": (feature.uncertainty or {}).get(axis),
             "bias": feature.bias.get(axis), "verdict": feature.axis_verdicts.get(axis)}
            for axis in named]


def _plain(value: Any) -> Any:  # noqa: ANN401  arrays become lists, whatever their shape
    return value.tolist()
