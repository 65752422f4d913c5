"""Judge a body: from what was measured to deviations and verdicts, in this order.

- temperature: lengths scaled to 20 degrees C (ISO 1);
- alignment: as the fixture holds the body, by 3-2-1 / RPS, or by best fit (`align`);
- offset: CMM correlation, CMM minus sensor, at the stop where it was learnt (`_corrected`);
- deviation: measured minus nominal by controlled axis; true position is 2 · |deviation in the
  hole's plane|, the diameter of its zone (ISO 1101);
- rule: simple, |deviation| ≤ tolerance; or guarded (ISO 14253-1) with g = z u, z the one-sided
  normal quantile (1.645 at 95 %): in up to tolerance - g, out beyond tolerance + g, else uncertain.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri

from cell.core.documents.job import Decision, JobDocument
from cell.core.documents.nominals import AXES, Hole
from cell.core.documents.offsets import Offset
from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start
from cell.core.documents.result import (
    BodyResult,
    BodyVerdict,
    Feature,
    Measured,
    NotMeasured,
    Outcome,
    Verdict,
)
from cell.core.geometry import Array
from cell.core.ports import Joints
from cell.metrology.judge.align import Aligned, Placed, align_body

REFERENCE_C = 20.0
SAME_STOP_DEG = 2.0  # of every joint: an offset learnt at another stop does not hold
CONSTANT_AT_A_STOP = ("intrinsics", "light_plane", "hand_eye", "robot", "registration")


@dataclass(frozen=True)
class Circumstances:
    """What else enters the judgement: the part's temperature where it was measured, the day as
    2026-11-22, and the joints (rad) reached at each hole's first view.
    """

    part_temperature_c: float | None = None
    day: str = ""
    reached: Mapping[str, Joints] = field(default_factory=dict)

    @classmethod
    def of_run(cls, start: Start, records: Sequence[HoleRecord]) -> Circumstances:
        """Take them from the papers of a run."""
        return cls(start.conditions.get("part_temperature_c"),
                   str(np.datetime64(int(start.started), "s"))[:10],
                   {record.observation.hole_id: record.observation.views[0].joints
                    for record in records if record.observation.views})


@dataclass(frozen=True, eq=False)
class _Circle:
    """A hole on its way to a verdict: centre (3,), diameter, covariance (4, 4) of both; mm.

    `constant` (4,) are the variances in it that are the same error whenever this stop is measured.
    """

    centre: Array
    diameter: float
    covariance: Array
    constant: Array

    @property
    def values(self) -> dict[str, float]:
        return dict(zip(AXES, (*map(float, self.centre), float(self.diameter)), strict=True))

    @property
    def sigmas(self) -> dict[str, float]:
        return dict(zip(AXES, map(float, np.sqrt(np.diag(self.covariance))), strict=True))


def judge_run(papers: Papers, start: Start, records: Sequence[HoleRecord]) -> BodyResult:
    """Judge a body from the records of its run: live and audit alike."""
    return judge_body(papers, [record.outcome for record in records],
                      Circumstances.of_run(start, records))


def judge_body(papers: Papers, outcomes: Sequence[Outcome],
               circumstances: Circumstances | None = None) -> BodyResult:
    """Judge all holes of a job, in its order; a hole without an outcome was not reached."""
    circumstances = circumstances or Circumstances()
    found = {outcome.hole_id: outcome for outcome in outcomes}
    circles = {outcome.hole_id: _at_20_degrees(outcome, papers.job, circumstances)
               for outcome in outcomes if isinstance(outcome, Measured)}
    aligned = align_body(papers.job.alignment,
                         [Placed(hole, circles[hole.id].centre, circles[hole.id].covariance[:3, :3])
                          for hole in papers.planned_holes if hole.id in circles])
    offsets, refused = sort_offsets(papers, circumstances)
    features = tuple(_judge_hole(hole, found.get(hole.id), circles.get(hole.id), aligned,
                                 offsets.get(hole.id, ()), papers.job.decision)
                     for hole in papers.planned_holes)
    summary = aligned.summary | ({"offsets_refused": refused} if refused else {})
    return BodyResult(_judge_features(features, aligned), features, summary)


def judge_axis(deviation: float, tolerance: float, sigma: float, decision: Decision) -> Verdict:
    """Judge one axis: all in mm, `sigma` the standard uncertainty of the deviation."""
    guard = float(ndtri(decision.confidence)) * sigma if decision.rule == "guarded" else 0.0
    if abs(deviation) <= tolerance - guard:
        return "in_tolerance"
    return "out_of_tolerance" if abs(deviation) > tolerance + guard else "uncertain"


def _at_20_degrees(outcome: Measured, job: JobDocument, circumstances: Circumstances) -> _Circle:
    aligned = job.alignment.method != "fixture"
    covariance = _without_registration(outcome) if aligned else outcome.covariance
    constant = _variances(outcome, CONSTANT_AT_A_STOP[:-1] if aligned else CONSTANT_AT_A_STOP)
    if job.thermal is None:
        return _Circle(outcome.centre, outcome.diameter, covariance, constant)
    measured = circumstances.part_temperature_c
    warmer = (job.thermal.part_temperature_c if measured is None else measured) - REFERENCE_C
    fixed = np.array(job.thermal.fixed_point)
    scale = 1.0 - job.thermal.expansion_per_kelvin * warmer
    return _Circle(fixed + scale * (outcome.centre - fixed), scale * outcome.diameter, covariance,
                   constant)


def _without_registration(outcome: Measured) -> Array:
    """Take the body registration out of the variances: aligning takes its error out of the body."""
    share = _variances(outcome, ["registration"])
    return np.diag(np.maximum(np.diag(outcome.covariance) - share, 0.0))


def _variances(outcome: Measured, sources: Sequence[str]) -> Array:
    """Add up what sources contribute to the variances of x, y, z and the diameter (4,)."""
    shares = [outcome.budget.get(source, (0.0, 0.0, 0.0, 0.0)) for source in sources]
    return np.asarray(np.square(shares).sum(axis=0))


def sort_offsets(papers: Papers, circumstances: Circumstances
                 ) -> tuple[dict[str, list[Offset]], dict[str, str]]:
    """Sort the offsets into those that hold now, by hole, and the reasons why others do not."""
    valid: dict[str, list[Offset]] = {}
    refused: dict[str, str] = {}
    for offset in papers.offsets.offsets if papers.offsets else ():
        reason = _why_not(offset, circumstances)
        if reason:
            refused[f"{offset.hole} {offset.axis}"] = reason
        else:
            valid.setdefault(offset.hole, []).append(offset)
    return valid, refused


def _why_not(offset: Offset, circumstances: Circumstances) -> str:
    if not circumstances.day or circumstances.day > offset.expires:
        return f"expired on {offset.expires}"
    joints = circumstances.reached.get(offset.hole)
    if joints is None:
        return "the stop was not reached"
    away = float(np.abs(np.degrees(joints) - np.array(offset.joints_deg)).max())
    return "" if away <= SAME_STOP_DEG else f"learnt at a stop {away:.0f} degrees away"


def _judge_hole(hole: Hole, outcome: Outcome | None, circle: _Circle | None, aligned: Aligned,
                offsets: Sequence[Offset], decision: Decision) -> Feature:
    if circle is None or aligned.problem:
        return _not_judged(hole, outcome, aligned)
    assert outcome is not None  # a circle comes from one
    circle = _corrected(circle, aligned, offsets)
    values, sigmas = circle.values, circle.sigmas
    deviation = {axis: values[axis] - nominal for axis, nominal in hole.nominal.items()}
    verdicts = {axis: judge_axis(deviation[axis], hole.tolerance[axis], sigmas[axis], decision)
                for axis in deviation}
    gap = circle.centre - hole.centre
    along_normal = float(gap @ hole.normal)
    in_plane = float(np.linalg.norm(gap - along_normal * hole.normal))
    bias = {axis: values[axis] - reference for axis, reference in (hole.cmm or {}).items()}
    return Feature(hole.id, _worst(verdicts.values()), outcome, hole.nominal, hole.tolerance,
                   values, deviation, sigmas, verdicts, in_plane, along_normal, 2.0 * in_plane,
                   bias, {offset.axis: offset.value_mm for offset in offsets})


def _not_judged(hole: Hole, outcome: Outcome | None, aligned: Aligned) -> Feature:
    if outcome is None:
        outcome = NotMeasured(hole.id, "not_reached", "the run ended before this hole")
    elif isinstance(outcome, Measured):
        outcome = NotMeasured(hole.id, "not_aligned", aligned.problem)
    return Feature(hole.id, "not_measured", outcome, hole.nominal, hole.tolerance)


def _corrected(circle: _Circle, aligned: Aligned, offsets: Sequence[Offset]) -> _Circle:
    """Align a circle and add its offsets, with what each changes of the uncertainty.

    What is the same error at every visit of a stop (sensor, hand-eye, the arm's kinematics, the
    registration) is in the offset, and so no longer in the result. In its place come the
    repeatability of one measurement, arm included, and the offset's own uncertainty. The picture's
    own shares stay: some of its scatter counts twice, on the safe side. Drift since the offset was
    learnt is in neither; the day it expires and the master check bound it.
    """
    values = np.array([*(aligned.aligned_from_body @ circle.centre), circle.diameter])
    covariance = circle.covariance.copy()
    covariance[:3, :3] = aligned.covariance(circle.centre, circle.covariance[:3, :3])
    for offset in offsets:
        axis = AXES.index(offset.axis)
        own = max(covariance[axis, axis] - circle.constant[axis], 0.0)
        values[axis] += offset.value_mm
        covariance[axis, :] = covariance[:, axis] = 0.0
        covariance[axis, axis] = own + offset.repeatability**2 + offset.variance
    return _Circle(values[:3], float(values[3]), covariance, circle.constant)


def _worst(verdicts: Iterable[Verdict]) -> Verdict:
    order: tuple[Verdict, ...] = ("in_tolerance", "uncertain", "out_of_tolerance")
    return max(verdicts, key=order.index, default="in_tolerance")


def _judge_features(features: Sequence[Feature], aligned: Aligned) -> BodyVerdict:
    verdicts = {feature.verdict for feature in features}
    if "out_of_tolerance" in verdicts:
        return "out_of_tolerance"
    if "not_measured" in verdicts:
        return "incomplete"
    return "uncertain" if "uncertain" in verdicts or aligned.summary.get("statement") \
        else "in_tolerance"
