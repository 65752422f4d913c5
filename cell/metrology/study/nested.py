"""The nested split of repeatability: what the sensor, the robot and the location each contribute.

Locations (the body taken out and put back) hold approaches (the robot leaves and returns), and
approaches hold repeats (nothing moves):

    y = mean + location + approach(location) + repeat(approach)

    | component | cause    | estimator (nested random ANOVA)                     |
    |-----------|----------|-----------------------------------------------------|
    | sensor    | repeat   | MS_repeat                                           |
    | robot     | approach | (MS_approach - MS_repeat) / k1                      |
    | location  | location | (MS_location - MS_repeat - k2/k1 (MS_approach - MS_repeat)) / k3 |

k1, k2, k3 are the expected numbers of repeats (Searle, Casella, McCulloch: Variance Components,
ch. 3); all trials alike they are r, r and r times the approaches. Intervals are the modified
large-sample ones of Ting et al. (1990), exact enough for balanced data and approximate otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cell.core.geometry import Array
from cell.metrology.study.studies import Interval, StudyRefusedError, sd_interval


@dataclass(frozen=True)
class Component:
    """One source of variation as a standard deviation, mm; `freedom` is that of its mean square."""

    cause: str
    sd: float
    interval: Interval
    freedom: int


@dataclass(frozen=True)
class MeanSquare:
    """A sum of squares over its degrees of freedom."""

    value: float
    freedom: int


def solve_components(values: Array, approaches: Sequence[str],
                     locations: Sequence[str] | None = None,
                     confidence: float = 0.95) -> tuple[Component, ...]:
    """Split the variance of `values` (n,) by the labels of their approach and their location.

    Raises:
        StudyRefusedError: no repeats, one approach only, or a single location where given.
    """
    values = np.asarray(values, dtype=np.float64)
    places = list(locations) if locations is not None else ["one"] * values.size
    stays = [f"{place}/{approach}" for place, approach in zip(places, approaches, strict=True)]
    repeat, approach = _within(values, stays), _between(values, stays, places)
    if repeat.freedom < 1 or approach.freedom < 1:
        raise StudyRefusedError("the split needs at least two approaches with repeats in each")
    k1, k2, k3 = _sizes(stays, places)
    parts = [Component("sensor", math.sqrt(repeat.value),
                       sd_interval(math.sqrt(repeat.value), repeat.freedom, confidence),
                       repeat.freedom),
             _component("robot", approach, repeat, k1, confidence)]
    if locations is not None:
        parts.append(_location(values, places, (repeat, approach), (k1, k2, k3), confidence))
    return tuple(parts)


def _location(values: Array, places: Sequence[str], below: tuple[MeanSquare, MeanSquare],
              sizes: tuple[float, float, float], confidence: float) -> Component:
    location = _between(values, places, ["all"] * values.size)
    if location.freedom < 1:
        raise StudyRefusedError("the share of the location needs at least two locations")
    (repeat, approach), (k1, k2, k3) = below, sizes
    expected = repeat.value + k2 / k1 * (approach.value - repeat.value)
    return _component("location", location, MeanSquare(expected, approach.freedom), k3, confidence)


def _component(cause: str, upper: MeanSquare, lower: MeanSquare, size: float,
               confidence: float) -> Component:
    variance = max(0.0, (upper.value - lower.value) / size)
    low, high = difference_interval(upper, lower, confidence)
    bounds = Interval(math.sqrt(max(0.0, low / size)), math.sqrt(max(0.0, high / size)))
    return Component(cause, math.sqrt(variance), bounds, upper.freedom)


def difference_interval(upper: MeanSquare, lower: MeanSquare,
                        confidence: float) -> tuple[float, float]:
    """Bound E[upper] - E[lower] of two mean squares (modified large sample, Ting et al. 1990)."""
    tail = (1.0 - confidence) / 2.0
    n, m, u, v = upper.freedom, lower.freedom, upper.value, lower.value
    g1, h2 = 1.0 - n / stats.chi2.ppf(1.0 - tail, n), m / stats.chi2.ppf(tail, m) - 1.0
    h1, g2 = n / stats.chi2.ppf(tail, n) - 1.0, 1.0 - m / stats.chi2.ppf(1.0 - tail, m)
    f_high, f_low = stats.f.ppf((1.0 - tail, tail), n, m)
    g12 = ((f_high - 1.0)**2 - (g1 * f_high)**2 - h2**2) / f_high
    h12 = ((1.0 - f_low)**2 - (h1 * f_low)**2 - g2**2) / f_low
    down = math.sqrt(max(0.0, (g1 * u)**2 + (h2 * v)**2 + g12 * u * v))
    up = math.sqrt(max(0.0, (h1 * u)**2 + (g2 * v)**2 + h12 * u * v))
    return u - v - down, u - v + up


def _within(values: Array, groups: Sequence[str]) -> MeanSquare:
    residuals = values - _means(values, groups)
    return _mean_square(residuals, values.size - len(set(groups)))


def _between(values: Array, groups: Sequence[str], parents: Sequence[str]) -> MeanSquare:
    return _mean_square(_means(values, groups) - _means(values, parents),
                        len(set(groups)) - len(set(parents)))


def _mean_square(deviations: Array, freedom: int) -> MeanSquare:
    return MeanSquare(float(np.sum(deviations**2)) / freedom if freedom else 0.0, freedom)


def _means(values: Array, groups: Sequence[str]) -> Array:
    """Replace each value by the mean of its group."""
    _, member = np.unique(list(groups), return_inverse=True)
    return (np.bincount(member, values) / np.bincount(member))[member]


def _sizes(stays: Sequence[str], places: Sequence[str]) -> tuple[float, float, float]:
    """Count the effective repeats: k1 of an approach, k2 and k3 of a location."""
    n = float(len(stays))
    per_stay, per_place = _counts(stays), _counts(places)
    in_place = sum(1.0 / size for size in per_place)          # number of locations
    shares = float(np.sum(per_stay / per_place))              # sum of n_ij² / n_i
    of_all = float(np.sum(per_stay)) / n                      # sum of n_ij² / n
    approaches = sum(1.0 / size for size in per_stay)
    k1 = (n - shares) / max(approaches - in_place, 1.0)
    between = max(in_place - 1.0, 1.0)
    return k1, (shares - of_all) / between, (n - float(np.sum(per_place)) / n) / between


def _counts(groups: Sequence[str]) -> Array:
    """Give each value the size of its group."""
    _, member = np.unique(list(groups), return_inverse=True)
    return np.bincount(member)[member].astype(np.float64)
