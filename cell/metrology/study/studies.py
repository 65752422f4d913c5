"""Measurement system studies: repeatability, type-1 (Cg/Cgk) and type-3 (no operator).

Formulas as in Bosch Booklet 10 and AIAG MSA; intervals at a stated two-sided confidence. An index
is refused where the values are too few to mean anything: a wrong number is worse than none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import stats

from cell.core.errors import CellError
from cell.core.geometry import Array

Judgement: TypeAlias = Literal["accepted", "conditional", "rejected"]

FEWEST_TYPE_1, ADVISED_TYPE_1 = 25, 50
FEWEST_PARTS, FEWEST_TRIALS = 5, 2


class StudyRefusedError(CellError):
    """Refuse an index that the values given cannot carry."""

    exit_code = 1


@dataclass(frozen=True)
class Interval:
    """A confidence interval; `high` may be infinite."""

    low: float
    high: float


@dataclass(frozen=True)
class Spread:
    """Repeated values of one quantity: `sd` is the sample standard deviation (n - 1)."""

    n: int
    mean: float
    sd: float
    sd_interval: Interval
    smallest: float
    largest: float

    @property
    def range(self) -> float:
        """Largest minus smallest value."""
        return self.largest - self.smallest


@dataclass(frozen=True)
class Type1Rule:
    """The customer's factors: share of the tolerance, number of sigmas, and the limit to reach."""

    share: float = 0.2
    sigmas: float = 6.0
    limit: float = 1.33


@dataclass(frozen=True)
class Type1:
    """One master, one place, measured again and again. `tolerance` is the full width T.

    `cg_low` and `cgk_low` are one-sided lower bounds; `bias_t` and `bias_p` the t-test of the bias;
    `smallest_tolerance` is the least T for which Cg would still reach the limit.
    """

    spread: Spread
    reference: float
    tolerance: float
    rule: Type1Rule
    bias: float
    bias_interval: Interval
    bias_t: float
    bias_p: float
    cg: float
    cg_low: float
    cgk: float
    cgk_low: float
    smallest_tolerance: float

    @property
    def capable(self) -> bool:
        """Whether both indices reach the limit."""
        return min(self.cg, self.cgk) >= self.rule.limit

    @property
    def bias_significant(self) -> bool:
        """Whether the bias differs from zero at 5 %."""
        return self.bias_p < 0.05


@dataclass(frozen=True)
class Type3:
    """Several parts measured several times by a machine that has no operator: one-way ANOVA.

    `ev` is the equipment variation and `pv` the part variation (standard deviations); `grr_percent`
    is 6 EV / T in percent; `ndc` the number of distinct categories.
    """

    parts: int
    trials: int
    ev: float
    ev_interval: Interval
    pv: float
    tolerance: float
    grr_percent: float
    grr_percent_interval: Interval
    ndc: int | None

    @property
    def judgement(self) -> Judgement:
        """Below 10 % accepted, to 30 % conditional, above rejected (AIAG)."""
        if self.grr_percent > 30.0:
            return "rejected"
        return "accepted" if self.grr_percent < 10.0 else "conditional"


def solve_spread(values: Array, confidence: float = 0.95) -> Spread:
    """Solve mean and standard deviation of repeated `values` (n,), with its chi-square interval.

    Raises:
        StudyRefusedError: fewer than two values.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.size < 2:
        raise StudyRefusedError(f"{values.size} value(s): a standard deviation needs at least 2")
    sd = float(np.std(values, ddof=1))
    interval = sd_interval(sd, values.size - 1, confidence)
    return Spread(values.size, float(values.mean()), sd, interval, float(values.min()),
                  float(values.max()))


def sd_interval(sd: float, freedom: int, confidence: float) -> Interval:
    """Bound a normal standard deviation known with `freedom` degrees of freedom (chi-square)."""
    tail = (1.0 - confidence) / 2.0
    low, high = stats.chi2.ppf((1.0 - tail, tail), freedom)
    return Interval(sd * math.sqrt(freedom / low), sd * math.sqrt(freedom / high))


def solve_type1(values: Array, reference: float, tolerance: float, rule: Type1Rule | None = None,
                confidence: float = 0.95) -> Type1:
    """Solve Cg = share T / (sigmas s) and Cgk = (share T / 2 - |bias|) / (sigmas s / 2).

    The lower bounds: chi-square for Cg, Bissell's approximation for Cgk.

    Raises:
        StudyRefusedError: fewer than 25 values, or no spread at all (a frozen value).
    """
    rule = rule or Type1Rule()
    spread = _enough_for_type1(values, confidence)
    freedom, half = spread.n - 1, rule.sigmas / 2.0
    bias, error = spread.mean - reference, spread.sd / math.sqrt(spread.n)
    reach = float(stats.t.ppf((1.0 + confidence) / 2.0, freedom)) * error
    cg = rule.share * tolerance / (rule.sigmas * spread.sd)
    cgk = (rule.share * tolerance / 2.0 - abs(bias)) / (half * spread.sd)
    bissell = math.sqrt(1.0 / (half**2 * spread.n) + cgk**2 / (2.0 * freedom))
    return Type1(
        spread, reference, tolerance, rule, bias, Interval(bias - reach, bias + reach),
        bias_t=bias / error, bias_p=float(2.0 * stats.t.sf(abs(bias / error), freedom)),
        cg=cg, cg_low=cg * math.sqrt(float(stats.chi2.ppf(1.0 - confidence, freedom)) / freedom),
        cgk=cgk, cgk_low=cgk - float(stats.norm.ppf(confidence)) * bissell,
        smallest_tolerance=rule.limit * rule.sigmas * spread.sd / rule.share)


def _enough_for_type1(values: Array, confidence: float) -> Spread:
    if np.size(values) < FEWEST_TYPE_1:
        raise StudyRefusedError(f"{np.size(values)} values: Cg and Cgk need at least "
                                f"{FEWEST_TYPE_1}, better {ADVISED_TYPE_1}")
    spread = solve_spread(values, confidence)
    if spread.sd == 0.0:
        raise StudyRefusedError("all values are equal: a frozen value, not a measurement")
    return spread


def solve_type3(trials_by_part: Sequence[Array], tolerance: float,
                confidence: float = 0.95) -> Type3:
    """Solve EV² = MS within, PV² = (MS between - MS within) / r by a one-way random ANOVA.

    `trials_by_part` holds one array a part, all with the same number r of trials.

    Raises:
        StudyRefusedError: fewer than 5 parts or 2 trials, or unequal numbers of trials.
    """
    parts, trials = len(trials_by_part), _trials(trials_by_part)
    table = np.array([np.asarray(row, dtype=np.float64) for row in trials_by_part])
    within = float(table.var(axis=1, ddof=1).mean())
    between = trials * float(table.mean(axis=1).var(ddof=1))
    ev, pv = math.sqrt(within), math.sqrt(max(0.0, (between - within) / trials))
    bounds = sd_interval(ev, parts * (trials - 1), confidence)
    percent = 600.0 / tolerance
    return Type3(parts, trials, ev, bounds, pv, tolerance, percent * ev,
                 Interval(percent * bounds.low, percent * bounds.high),
                 math.floor(1.41 * pv / ev) if ev > 0.0 else None)


def _trials(trials_by_part: Sequence[Array]) -> int:
    counts = {len(row) for row in trials_by_part}
    if len(trials_by_part) < FEWEST_PARTS:
        raise StudyRefusedError(f"{len(trials_by_part)} part(s): a type-3 study needs at least "
                                f"{FEWEST_PARTS}, better 25")
    if len(counts) > 1:
        raise StudyRefusedError(f"parts were measured {sorted(counts)} times: give each part the "
                                "same number of trials")
    if min(counts) < FEWEST_TRIALS:
        raise StudyRefusedError(f"each part was measured once: at least {FEWEST_TRIALS} trials")
    return counts.pop()
