"""Learn CMM correlation offsets: what a known body says of the sensor's error, by hole and axis.

A master body, measured by a CMM, is measured here some times. Each time leaves a difference, CMM
minus sensor, at 20 degrees C, after alignment and without any offset that held then. Their mean is
what the sensor's whole chain gets wrong at this stop: hand-eye, kinematics, registration, light.

A few runs tell a mean well and a spread badly. The repeatability that an offset carries is
therefore never below that of all holes together (pooled over centres, and over diameters).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from cell.core.documents.base import Vector6
from cell.core.documents.nominals import Hole
from cell.core.documents.offsets import Offset, OffsetsDocument
from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start
from cell.core.geometry import Array
from cell.core.ports import Joints
from cell.metrology.judge.decide import SAME_STOP_DEG, Circumstances, judge_body

FEWEST_RUNS = 3
AXES: tuple[Literal["x", "y", "z", "d"], ...] = ("x", "y", "z", "d")
COVERED = 3.0  # standard uncertainties
CHANCE = 0.05  # a bias that chance would give more rarely is one


@dataclass(frozen=True, eq=False)
class MasterRun:
    """One run over the master: its day, and by hole the values by axis (mm, without offsets), their
    standard uncertainties, and the joints of the stop (rad).
    """

    day: str
    values: Mapping[str, Mapping[str, float]]
    sigmas: Mapping[str, Mapping[str, float]]
    joints: Mapping[str, Joints]


@dataclass(frozen=True, eq=False)
class Learnt:
    """One offset and what it was learnt from: `measured` (n,) and `cmm`, mm; `stated` is the
    standard uncertainty without the offset, mm; the t-test of the differences against zero, `t`
    infinite where they do not scatter.
    """

    offset: Offset
    measured: Array
    cmm: float
    stated: float
    t: float
    p: float

    @property
    def u(self) -> float:
        """Standard uncertainty of the offset, mm."""
        return math.sqrt(self.offset.variance)

    @property
    def is_significant(self) -> bool:
        """Whether the sensor's error differs from zero at 5 %."""
        return self.p < CHANCE

    @property
    def is_explained(self) -> bool:
        """Whether the stated uncertainty of sensor and CMM covers what the sensor gets wrong."""
        return abs(self.offset.value_mm) <= COVERED * math.hypot(self.stated, self.u)


@dataclass(frozen=True, eq=False)
class OffsetsStudy:
    """The offsets of one job; `left_out` says by hole why there is none, `remarks` what else."""

    learnt: tuple[Learnt, ...]
    left_out: Mapping[str, str]
    remarks: tuple[str, ...]

    @property
    def document(self) -> OffsetsDocument:
        """What `offsets/<job>.yaml` takes."""
        return OffsetsDocument(offsets=tuple(each.offset for each in self.learnt))


def judge_master_run(papers: Papers, start: Start, records: Sequence[HoleRecord]) -> MasterRun:
    """Judge a recorded run over the master again, without the offsets that held then."""
    circumstances = Circumstances.of_run(start, records)
    result = judge_body(replace(papers, offsets=None), [record.outcome for record in records],
                        circumstances)
    seen = [feature for feature in result.features if feature.measured is not None]
    return MasterRun(circumstances.day,
                     {feature.id: feature.measured or {} for feature in seen},
                     {feature.id: feature.uncertainty or {} for feature in seen},
                     circumstances.reached)


def learn_offsets(runs: Sequence[MasterRun], holes: Sequence[Hole], expires: str,
                  by: str = "") -> OffsetsStudy:
    """Learn the offsets of all holes that the CMM knows.

    Args:
        runs: over the same body, with the same job and calibration.
        holes: with the CMM's values.
        expires: the last day on which the offsets hold, as 2026-11-22.
        by: who learnt them.
    """
    reasons = {hole.id: reason for hole in holes if (reason := _why_not(hole, runs))}
    known = [hole for hole in holes if hole.id not in reasons]
    single = [learnt for hole in known
              for learnt in _learn(hole, _of_hole(hole, runs), expires, by)]
    learnt = tuple(_pooled(single))
    return OffsetsStudy(learnt, reasons, tuple(_remarks(learnt, known)))


def _remarks(learnt: Sequence[Learnt], holes: Sequence[Hole]) -> Iterator[str]:
    unstated = [hole.id for hole in holes if hole.cmm_u is None]
    if unstated:
        yield f"the CMM's uncertainty is not stated, and counts as 0: {', '.join(unstated)}"
    beyond = [f"{each.offset.hole} {each.offset.axis}" for each in learnt if not each.is_explained]
    if beyond:
        yield ("beyond what the stated uncertainty explains: " + ", ".join(beyond)
               + "; look for the cause (calibration, fixture, CMM values) before correcting it")


def _of_hole(hole: Hole, runs: Sequence[MasterRun]) -> list[MasterRun]:
    return [run for run in runs if hole.id in run.values and hole.id in run.joints]


def _why_not(hole: Hole, runs: Sequence[MasterRun]) -> str:
    if not hole.cmm:
        return "no CMM values in the nominals"
    measured = _of_hole(hole, runs)
    if len(measured) < FEWEST_RUNS:
        return f"measured in {len(measured)} of {len(runs)} runs; at least {FEWEST_RUNS} are needed"
    apart = float(np.degrees(np.ptp([run.joints[hole.id] for run in measured], axis=0)).max())
    if apart > SAME_STOP_DEG:
        return f"measured from stops {apart:.1f} degrees apart: an offset holds at one stop"
    return ""


def _learn(hole: Hole, runs: Sequence[MasterRun], expires: str, by: str) -> Iterator[Learnt]:
    """Learn each axis of a hole, with its own spread for repeatability."""
    cmm, joints = hole.cmm or {}, _stop([run.joints[hole.id] for run in runs])
    for axis in AXES:
        if axis not in cmm:
            continue
        measured = np.array([run.values[hole.id][axis] for run in runs])
        differences = cmm[axis] - measured
        t, p = _t_test(differences)
        yield Learnt(Offset(
            hole=hole.id, axis=axis, value_mm=_rounded(differences.mean()),
            spread_mm=_rounded(differences.std(ddof=1)), sample_size=len(runs), joints_deg=joints,
            learnt=max(run.day for run in runs), expires=expires, by=by,
            cmm_u_mm=hole.cmm_u or 0.0), measured, cmm[axis],
            float(np.mean([run.sigmas[hole.id][axis] for run in runs])), t, p)


def _stop(joints: Sequence[Joints]) -> Vector6:
    """The mean of the joints, in degrees."""
    a, b, c, d, e, f = np.degrees(joints).mean(axis=0).round(3).tolist()
    return a, b, c, d, e, f


def _t_test(differences: Array) -> tuple[float, float]:
    """Student's t of the mean against zero, and its two-sided probability."""
    mean, error = differences.mean(), differences.std(ddof=1) / math.sqrt(differences.size)
    t = float(mean / error) if error > 0.0 else math.copysign(math.inf, mean) if mean else 0.0
    return t, float(2.0 * stats.t.sf(abs(t), differences.size - 1))


def _pooled(single: Sequence[Learnt]) -> Iterator[Learnt]:
    """Give every offset a repeatability that its few runs alone cannot make too small by luck."""
    pools = {kind: _pool([each.offset for each in single if (each.offset.axis == "d") == kind])
             for kind in (True, False)}
    for each in single:
        offset = each.offset
        least = _rounded(max(offset.spread_mm, pools[offset.axis == "d"]))
        yield replace(each, offset=offset.model_copy(update={"repeatability_mm": least}))


def _pool(offsets: Sequence[Offset]) -> float:
    """Pool standard deviations by their degrees of freedom."""
    freedom = sum(offset.sample_size - 1 for offset in offsets)
    squares = sum((offset.sample_size - 1) * offset.spread_mm**2 for offset in offsets)
    return math.sqrt(squares / freedom) if freedom else 0.0


def _rounded(value: float) -> float:
    """Round to 10 nm, which is far below any uncertainty here."""
    return round(float(value), 5)
