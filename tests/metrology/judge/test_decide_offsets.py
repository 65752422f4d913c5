"""CMM offsets in the judgement, and the circumstances of the run under which they hold."""

import dataclasses

import numpy as np
import pytest
from made_outcomes import BEST_FIT, SIGMA, body, by_id, measured, with_job

from cell.core.documents.job import Alignment
from cell.core.documents.offsets import Offset, OffsetsDocument
from cell.core.documents.record import Attempt, HoleRecord, Start
from cell.core.geometry import Transform
from cell.core.observation import Observation, View
from cell.metrology.judge.decide import Circumstances, judge_body, judge_run

STOP_DEG = (150.0, -90.0, 110.0, -10.0, 60.0, 160.0)
OFFSET = Offset(hole="BP1", axis="y", value_mm=0.042, spread_mm=0.02, sample_size=4,
                joints_deg=STOP_DEG, learnt="2026-11-01", expires="2026-12-01")
TODAY = Circumstances(day="2026-11-22", reached={"BP1": tuple(np.radians(STOP_DEG))})


def with_offset(papers, offset=OFFSET):
    return dataclasses.replace(papers, offsets=OffsetsDocument(offsets=(offset,)))


def test_a_cmm_offset_is_added_and_the_raw_value_kept(papers):
    hole = papers.hole("BP1")
    outcome = measured(hole, np.add(hole.centre, [0, -0.042, 0]))
    feature = by_id(judge_body(with_offset(papers), [outcome], TODAY))["BP1"]
    assert feature.deviation["y"] == pytest.approx(0.0, abs=1e-9)
    assert feature.offset == {"y": 0.042}
    assert feature.outcome.centre[1] == hole.centre[1] - 0.042
    assert feature.uncertainty["y"] == pytest.approx(np.sqrt(SIGMA**2 + 0.02**2 + 0.02**2 / 4))
    assert feature.uncertainty["x"] == pytest.approx(SIGMA)


CHAIN = {"hand_eye": (0.06, 0.05, 0.04, 0.0), "robot": (0.1, 0.12, 0.11, 0.0),
         "registration": (0.05, 0.07, 0.06, 0.0), "intrinsics": (0.01, 0.02, 0.01, 0.004)}


def through_the_chain(hole):
    """A hole with the uncertainty of the whole way to the body, all of its axes linked."""
    shares = np.array(list(CHAIN.values()))
    covariance = np.eye(4) * SIGMA**2 + shares.T @ shares
    return dataclasses.replace(measured(hole, hole.centre), covariance=covariance, budget=CHAIN)


@pytest.mark.parametrize("alignment", [Alignment(), BEST_FIT])
def test_an_offset_takes_the_place_of_what_is_constant_at_its_stop(papers, alignment):
    known = OFFSET.model_copy(update={"repeatability_mm": 0.03, "cmm_u_mm": 0.01})
    papers = with_job(with_offset(papers, known), alignment=alignment)
    outcomes = [through_the_chain(papers.hole(o.hole_id)) for o in body(papers)]
    feature = by_id(judge_body(papers, outcomes, TODAY))["BP1"]
    plain = by_id(judge_body(papers, outcomes, Circumstances()))["BP1"]
    left = np.sqrt(SIGMA**2 + 0.03**2 + 0.03**2 / 4 + 0.01**2)
    added = plain.uncertainty["y"]**2 - SIGMA**2 - np.sum(
        [share[1]**2 for name, share in CHAIN.items()
         if name != "registration" or alignment.method == "fixture"])
    assert feature.uncertainty["y"] == pytest.approx(np.sqrt(left**2 + added), rel=1e-3)
    assert added == pytest.approx(0.0, abs=1e-9) or alignment is BEST_FIT
    assert plain.uncertainty["y"] > 2.0 * left
    for axis in "xzd":
        assert feature.uncertainty[axis] == plain.uncertainty[axis]


@pytest.mark.parametrize(("circumstances", "reason"), [
    (dataclasses.replace(TODAY, day="2026-12-02"), "expired on 2026-12-01"),
    (dataclasses.replace(TODAY, reached={}), "not reached"),
    (dataclasses.replace(TODAY, reached={"BP1": tuple(np.radians([*STOP_DEG[:5], 171.4]))}),
     "learnt at a stop 11 degrees away"),
    (Circumstances(), "expired"),
])
def test_an_offset_that_does_not_hold_is_not_applied_and_said(papers, circumstances, reason):
    result = judge_body(with_offset(papers), body(papers), circumstances)
    assert reason in result.alignment["offsets_refused"]["BP1 y"]
    assert by_id(result)["BP1"].offset == {}
    assert by_id(result)["BP1"].deviation["y"] == pytest.approx(0.0, abs=1e-9)


def test_an_offset_holds_to_the_end_of_its_last_day(papers):
    last = dataclasses.replace(TODAY, day="2026-12-01")
    assert by_id(judge_body(with_offset(papers), body(papers), last))["BP1"].offset


def test_a_run_is_judged_by_its_own_date_joints_and_temperature(papers):
    papers = with_offset(papers)
    image = np.zeros((2, 2), np.uint8)
    view = View(image, "ring", 0.01, 0.0, Transform.identity(), Transform.identity(),
                tuple(np.radians(STOP_DEG)))
    record = HoleRecord(0, Observation("BP1", (view,), Transform.identity()),
                        (Attempt(1, body(papers)[0]),))
    start = Start("r", "b", 1_795_305_600.0, papers.set_id, papers.texts, {}, {},
                  {"part_temperature_c": 22.0})
    circumstances = Circumstances.of_run(start, [record])
    assert circumstances.day == "2026-11-22"
    assert circumstances.part_temperature_c == 22.0
    assert by_id(judge_run(papers, start, [record]))["BP1"].offset == {"y": 0.042}
