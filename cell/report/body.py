"""The report of one body: a self-contained HTML page that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from jinja2 import Environment, PackageLoader, select_autoescape

from cell.core.documents.nominals import AXES, Hole
from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.documents.result import BodyResult, Feature, Measured
from cell.report.crop import draw_crop
from cell.report.deviation_picture import draw_deviations

VERDICTS = {"in_tolerance": "in tolerance", "out_of_tolerance": "out of tolerance",
            "uncertain": "uncertain", "not_measured": "not measured", "incomplete": "incomplete"}
BAR_RANGE = 1.5  # of the tolerance, shown to either side


@dataclass(frozen=True, eq=False)
class BodyRun:
    """What a report is made of: the papers of one run, in memory or read from its recording."""

    start: Start
    records: Sequence[HoleRecord]
    stop: Stop | None
    holes: Sequence[Hole]


@dataclass(frozen=True)
class Row:
    """One axis of one feature, as printed, and as shares of the bar's width (0 to 100)."""

    axis: str
    nominal: float | None
    measured: float | None
    deviation: float | None
    tolerance: float | None
    uncertainty: float | None
    verdict: str | None

    @property
    def bar(self) -> dict[str, float] | None:
        """Where deviation and expanded uncertainty (k = 2) lie on the tolerance bar, in %."""
        if self.deviation is None or not self.tolerance:
            return None
        scale = 50.0 / (BAR_RANGE * self.tolerance)
        at = 50.0 + self.deviation * scale
        spread = 2.0 * (self.uncertainty or 0.0) * scale
        return {"at": _within(at), "low": _within(at - spread), "high": _within(at + spread),
                "lower_limit": 50.0 - self.tolerance * scale,
                "upper_limit": 50.0 + self.tolerance * scale}


def body_report(run: BodyRun) -> str:
    """Write the page of one body.

    Every number on it is one that the recording holds and the audit recomputes.
    """
    result = run.stop.result if run.stop else None
    pages = Environment(loader=PackageLoader("cell.report"), autoescape=select_autoescape())
    return pages.get_template("body.html.j2").render(
        start=run.start, stop=run.stop, result=result, verdicts=VERDICTS,
        begun=_moment(run.start.started), ended=_moment(run.stop.finished) if run.stop else None,
        picture=draw_deviations(result.features, run.holes) if result else "",
        features=[(feature, _rows(feature)) for feature in (result.features if result else ())],
        closer=_closer_looks(run, result), counts=_counts(result), effort=_effort(run),
        alignment=[(name.replace("_", " "), _in_words(value))
                   for name, value in (result.alignment if result else {}).items()
                   if value not in ("", [], {}, None)],
    )


def _rows(feature: Feature) -> list[Row]:
    def pick(values: dict[str, float] | None, axis: str) -> float | None:
        return (values or {}).get(axis)

    return [Row(axis, pick(feature.nominal, axis), pick(feature.measured, axis),
                pick(feature.deviation, axis), pick(feature.tolerance, axis),
                pick(feature.uncertainty, axis), feature.axis_verdicts.get(axis))
            for axis in AXES if axis in feature.nominal or pick(feature.measured, axis) is not None]


def _counts(result: BodyResult | None) -> dict[str, int]:
    verdicts = [feature.verdict for feature in result.features] if result else []
    return {words: verdicts.count(code)
            for code, words in VERDICTS.items() if code in verdicts}


def _closer_looks(run: BodyRun, result: BodyResult | None) -> list[dict[str, object]]:
    """Show the last pictures of every feature that is not simply in tolerance."""
    suspects = {feature.id: feature for feature in (result.features if result else ())
                if feature.verdict != "in_tolerance"}
    return [{"feature": suspects[record.observation.hole_id], "crops": _crops(record)}
            for record in run.records if record.observation.hole_id in suspects]


def _crops(record: HoleRecord) -> list[tuple[str, str]]:
    located = record.outcome.located if isinstance(record.outcome, Measured) else None
    last = {view.light: view.image for view in record.observation.views if view.image.size}
    return [(light, draw_crop(image, located)) for light, image in sorted(last.items(),
                                                                          reverse=True)]


def _effort(run: BodyRun) -> list[dict[str, object]]:
    """List the holes that took more than one look, and what the looks decided."""
    return [{"id": record.observation.hole_id,
             "decisions": [attempt.decision for attempt in record.attempts]}
            for record in run.records if len(record.attempts) > 1]


def _in_words(value: object) -> str:
    """Write a value of the alignment's summary for people: four digits are enough."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(_in_words(one) for one in value)
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_in_words(one)}" for name, one in value.items())
    return str(value)


def _moment(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _within(share: float) -> float:
    return min(100.0, max(0.0, share))
