"""Comparing what was recorded with what comes out now, number by number.

A number is *identical* bit for bit; *reproduced* within 0.01 of its standard uncertainty, which is
what other versions and other processors cost; else it *differs*. What has no uncertainty of its own
is held to that of the result it belongs to:

| number | reproduced within |
|---|---|
| centre, radius, diameter; a feature's values by axis | 0.01 u |
| covariances and their sources | 0.01 u u' of the two quantities |
| the budget's shares | 0.01 u of the quantity |
| a normal | the angle that moves the rim by 0.01 u |
| points over the images | 0.01 px |
| what the gates looked at | 1 % |
| texts, verdicts, reasons, counts | the same |
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from cell.core.documents.result import BodyResult, Feature, Located, Measured
from cell.core.geometry import Array

Level: TypeAlias = Literal["identical", "reproduced", "differs"]

SHARE = 0.01
PIXELS = 0.01


@dataclass(frozen=True)
class Difference:
    """One field that is not identical: by how much, and what would count as reproduced."""

    where: str
    level: Level
    recorded: str
    recomputed: str
    difference: float | None = None
    limit: float | None = None


@dataclass(frozen=True)
class Comparison:
    """One field: how many numbers it holds, and what is different about it, if anything."""

    numbers: int
    difference: Difference | None = None


Anything: TypeAlias = Any  # a field of a record, whatever it holds


def compare(where: str, recorded: Anything, recomputed: Anything,
            limit: Anything = 0.0) -> Iterator[Comparison]:
    """Compare two records field by field.

    Args:
        where: the name of the record, with which each field's name begins.
        recorded: what the recording says.
        recomputed: what comes out now.
        limit: the difference that counts as reproduced, by field or for all, where a record does
            not set its own.
    """
    parts, others = _parts(recorded), _parts(recomputed)
    if parts is None or others is None or type(recorded) is not type(recomputed):
        yield _compare_leaf(where, recorded, recomputed, limit)
        return
    limits = _limits(recorded) if is_dataclass(recorded) else limit
    for name in parts | others:
        inner = limits.get(name, 0.0) if isinstance(limits, Mapping) else limits
        yield from compare(f"{where} {name}", parts.get(name), others.get(name), inner)


def _parts(value: Anything) -> dict[str, Anything] | None:
    """Take apart what has named or numbered parts; a row of numbers has none.

    The outcome behind a feature is left out: it is compared with its hole.
    """
    if isinstance(value, float | np.ndarray | str):
        return None
    if isinstance(value, dict):
        return value
    if isinstance(value, tuple | list) and not all(isinstance(each, float) for each in value):
        return {getattr(each, "id", str(index)): each for index, each in enumerate(value)}
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)
                if not (isinstance(value, Feature) and field.name == "outcome")}
    return None


def _compare_leaf(where: str, recorded: Anything, recomputed: Anything,
                  limit: Anything) -> Comparison:
    if _is_number(recorded) and _is_number(recomputed):
        return _compare_numbers(where, np.asarray(recorded), np.asarray(recomputed), limit)
    if type(recorded) is type(recomputed) and recorded == recomputed:
        return Comparison(1)
    return Comparison(1, Difference(where, "differs", _words(recorded), _words(recomputed)))


def _compare_numbers(where: str, recorded: Array, recomputed: Array, limit: Anything) -> Comparison:
    if recorded.shape != recomputed.shape:
        return Comparison(recorded.size, Difference(where, "differs", f"{recorded.shape} numbers",
                                                    f"{recomputed.shape} numbers"))
    if recorded.tobytes() == recomputed.tobytes():
        return Comparison(recorded.size)
    gap = np.where(np.isnan(recorded) & np.isnan(recomputed), 0.0, np.abs(recorded - recomputed))
    limits = np.broadcast_to(limit, gap.shape)
    worst = np.unravel_index(np.argmax(gap - limits), gap.shape)
    level: Level = "reproduced" if (gap <= limits).all() else "differs"
    return Comparison(recorded.size, Difference(
        where, level, _words(recorded[worst]), _words(recomputed[worst]),
        _finite(gap[worst]), _finite(limits[worst])))


def _finite(value: np.floating) -> float | None:
    return float(value) if np.isfinite(value) else None


def _is_number(value: Anything) -> bool:
    return isinstance(value, float | np.ndarray | tuple | list) and not isinstance(value, str)


def _words(value: Anything) -> str:
    return repr(float(value)) if isinstance(value, float | np.ndarray) else str(value)


def _limits(record: Anything) -> dict[str, Anything]:
    """Return what counts as reproduced in the fields of a record that has an uncertainty."""
    if isinstance(record, Located):
        return _limits_of_circle(record.covariance, record.radius) | {
            "radius": SHARE * _sigmas(record.covariance)[3],
            "quality": {name: SHARE * abs(value) for name, value in record.quality.items()}}
    if isinstance(record, Measured):
        return _limits_of_circle(record.covariance, record.diameter / 2.0) | {
            "diameter": SHARE * _sigmas(record.covariance)[3]}
    if isinstance(record, Feature):
        return _limits_of_feature(record)
    if isinstance(record, BodyResult):
        sigmas = [s for f in record.features for s in (f.uncertainty or {}).values()]
        return {"alignment": SHARE * min(sigmas, default=0.0)}
    return {}


def _sigmas(covariance: Array) -> Array:
    return np.sqrt(np.abs(np.diag(covariance)))


def _limits_of_circle(covariance: Array, radius: float) -> dict[str, Anything]:
    sigmas = _sigmas(covariance)
    products = SHARE * np.outer(sigmas, sigmas)
    return {"centre": SHARE * sigmas[:3], "covariance": products, "sources": products,
            "budget": SHARE * sigmas, "normal": SHARE * float(sigmas[:3].max()) / radius,
            "trace": PIXELS}


def _limits_of_feature(feature: Feature) -> dict[str, Anything]:
    by_axis = {axis: SHARE * sigma for axis, sigma in (feature.uncertainty or {}).items()}
    largest = max(by_axis.values(), default=0.0)
    return {**dict.fromkeys(("measured", "deviation", "uncertainty", "bias", "offset"), by_axis),
            **dict.fromkeys(("in_plane", "along_normal"), largest), "true_position": 2 * largest}
