"""Compare measured points with nominals: deviations, and what they say by axis.

The mean is the bias, the sample standard deviation (n - 1) the spread about it; t = mean / (sd /
sqrt(n)) and its two-sided p (Student, n - 1 degrees of freedom) tell whether the bias is more than
chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from cell.core.documents.nominals import AXES
from cell.core.documents.points import Point
from cell.core.errors import DocumentError

LIKE_METRES = 0.01  # a thousandth is meant; what a body can be off by is far from it


@dataclass(frozen=True)
class Deviations:
    """One measured point minus its nominal, by the axes that count (mm)."""

    id: str
    values: dict[str, float]


@dataclass(frozen=True)
class Statistics:
    """One axis over `n` values (mm): `max` is the largest size, at `max_id`. None where n is too
    small to say.
    """

    n: int
    mean: float
    sd: float | None
    rms: float
    max: float
    max_id: str
    t: float | None
    p: float | None


@dataclass(frozen=True)
class Comparison:
    """All deviations, their statistics by axis, the spread (sd by axis) of each id that was
    measured more than once with its count, and the nominals that were not measured.
    """

    points: tuple[Deviations, ...]
    axes: dict[str, Statistics]
    repeatability: dict[str, tuple[int, dict[str, float]]]
    missing: tuple[str, ...]


def compare_points(measured: Sequence[Point], nominals: Sequence[Point],
                   source: str = "measured") -> Comparison:
    """Compare measured points with the nominals of the same id.

    Raises:
        DocumentError: names `source`: an id without nominal, no common axis at all, or tables in
            unlike units.
    """
    by_id = {point.id: point for point in nominals}
    unknown = list(dict.fromkeys(point.id for point in measured if point.id not in by_id))
    if unknown:
        raise DocumentError(f"measured but not among the nominals: {', '.join(unknown)}",
                            source=source)
    points = tuple(_deviations(point, by_id[point.id]) for point in measured)
    axes = {axis: _statistics(axis, points) for axis in AXES
            if any(axis in point.values for point in points)}
    if not axes:
        raise DocumentError("no point has an axis that is both measured and controlled",
                            source=source)
    _check_units(measured, by_id, source)
    seen = {point.id for point in measured}
    return Comparison(points, axes, _repeatability(points),
                      tuple(point.id for point in nominals if point.id not in seen))


def _deviations(measured: Point, nominal: Point) -> Deviations:
    return Deviations(measured.id, {axis: value - nominal.values[axis]
                                    for axis, value in measured.values.items()
                                    if axis in nominal.values})


def _statistics(axis: str, points: Sequence[Deviations]) -> Statistics:
    ids, values = zip(*[(point.id, point.values[axis]) for point in points
                        if axis in point.values], strict=True)
    deviations, n = np.array(values), len(values)
    mean, worst = float(deviations.mean()), int(np.abs(deviations).argmax())
    sd = float(deviations.std(ddof=1)) if n > 1 else None
    t = mean / (sd / float(np.sqrt(n))) if sd else None
    return Statistics(n, mean, sd, float(np.sqrt(np.mean(deviations**2))),
                      float(np.abs(deviations[worst])), ids[worst], t,
                      None if t is None else 2.0 * float(stdtr(n - 1, -abs(t))))


def _repeatability(points: Sequence[Deviations]) -> dict[str, tuple[int, dict[str, float]]]:
    spreads = {}
    for name in dict.fromkeys(point.id for point in points):
        runs = [point.values for point in points if point.id == name]
        if len(runs) > 1:
            common = [axis for axis in AXES if all(axis in run for run in runs)]
            spreads[name] = (len(runs), {axis: float(np.std([run[axis] for run in runs], ddof=1))
                                         for axis in common})
    return spreads


def _check_units(measured: Sequence[Point], nominals: dict[str, Point], source: str) -> None:
    """Refuse one table in metres and the other in millimetres."""
    pairs = np.array([(value, nominals[point.id].values[axis]) for point in measured
                      for axis, value in point.values.items() if axis in nominals[point.id].values])
    sizes = np.abs(pairs).sum(axis=0)
    if sizes.min() < LIKE_METRES * sizes.max():
        small, large = ("measured", "nominal") if sizes[0] < sizes[1] else ("nominal", "measured")
        raise DocumentError(f"the {small} values are a thousandth of the {large} ones: metres "
                            "beside millimetres; expected millimetres in both", source=source)
