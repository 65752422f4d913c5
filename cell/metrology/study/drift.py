"""Whether the cell still measures as it did: fixed artefacts, seen again and again.

Single readings scatter; an exponentially weighted moving average of the shift (S. Roberts,
Technometrics 1 (1959) 239) sees slow drift below the scatter. Shift and turn of all artefacts
together are what may be corrected, within bounds; what is left over bends, and calls for a new
calibration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from cell.core.geometry import Array, Transform
from cell.metrology.motions import lay_onto

Alarm: TypeAlias = Literal["ok", "warn", "act", "stop", "repeat"]

WEIGHT = 0.2             # of the newest reading in the average
SINGLE = 0.18            # mm: a single reading beyond three standard deviations is repeated first
MOST_SHIFT_MM, MOST_TURN_DEG = 0.3, 0.03  # that a correction may ever be
WIDE = 200.0             # mm between artefacts, below which they tell a shift but hardly a turn
BENT = 0.10              # mm left over after the rigid part: no correction, calibrate again


@dataclass(frozen=True, eq=False)
class Drift:
    """What a check found: the shift (3,) mm of every artefact, and their common rigid part.

    `reference_from_now` carries points measured now to where they were measured before;
    `left_over` (mm, rms) remains after it. `average` is the moving average of the mean shift
    (3,) with all checks before.
    """

    shifts: Mapping[str, Array]
    reference_from_now: Transform
    left_over: float
    average: Array
    alarm: Alarm

    @property
    def correctable(self) -> bool:
        """Whether the rigid part may be applied on request: small, and nothing bends."""
        return is_small(self.reference_from_now) and self.left_over <= BENT


def is_small(correction: Transform) -> bool:
    """Tell whether a correction is within what one may ever be."""
    millimetres, radians = correction.distance(Transform.identity())
    return millimetres <= MOST_SHIFT_MM and float(np.degrees(radians)) <= MOST_TURN_DEG


def judge_drift(reference: Mapping[str, Array], now: Mapping[str, Array],
                averages: Sequence[Array], limits: Mapping[str, float]) -> Drift:
    """Judge artefacts measured now against their reference, both (3,) mm in the base by name.

    Args:
        reference: as measured when the set was made.
        now: as measured now; artefacts in only one of the two do not count.
        averages: the moving averages (3,) of the checks before, oldest first.
        limits: `warn`, `act` and `stop` of the moving average, mm.

    Raises:
        ValueError: no artefact in common.
    """
    names = [name for name in reference if name in now]
    if not names:
        raise ValueError("no artefact was seen that has a reference")
    before, after = (np.array([where[name] for name in names]) for where in (reference, now))
    shifts = after - before
    mean = shifts.mean(axis=0)
    average = mean if not averages else (1.0 - WEIGHT) * averages[-1] + WEIGHT * mean
    back = _rigid(after, before)
    left = before - back @ after
    return Drift(dict(zip(names, shifts, strict=True)), back,
                 float(np.sqrt(np.mean(np.sum(left ** 2, axis=1)))), average,
                 _alarm(mean, average, averages, limits))


def _alarm(mean: Array, average: Array, averages: Sequence[Array],
           limits: Mapping[str, float]) -> Alarm:
    """The average decides; a first reading far off everything before is repeated."""
    jump = float(np.linalg.norm(mean - averages[-1])) if averages else 0.0
    if jump > SINGLE:
        return "repeat"
    size = float(np.linalg.norm(average))
    levels: tuple[Literal["stop", "act", "warn"], ...] = ("stop", "act", "warn")
    return next((level for level in levels if size > limits[level]), "ok")


def _rigid(now: Array, before: Array) -> Transform:
    """With three artefacts and more, far apart, shift and turn; else the shift alone: a turn from
    artefacts close together would be carried far beyond them.
    """
    if len(now) >= 3 and np.ptp(before, axis=0).max() >= WIDE:
        return lay_onto(now, before)
    return Transform.from_parts(np.eye(3), (before - now).mean(axis=0))
