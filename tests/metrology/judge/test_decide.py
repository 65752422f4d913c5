"""Deviations, verdicts, guard bands: a body judged as the fixture holds it."""

import dataclasses

import numpy as np
import pytest
from made_outcomes import body, by_id, measured, with_job

from cell.core.documents.job import Decision
from cell.core.documents.result import NotMeasured
from cell.metrology.judge.decide import judge_axis, judge_body


def test_a_body_on_its_nominals_is_in_tolerance(papers):
    result = judge_body(papers, body(papers))
    assert result.verdict == "in_tolerance"
    assert [feature.id for feature in result.features] == [s.hole for s in papers.job.stops]
    assert all(abs(gap) < 1e-9 for feature in result.features
               for gap in feature.deviation.values())


def test_only_controlled_axes_count(papers):
    hole = papers.hole("BP4")
    assert hole.control == {"x", "z", "d"}
    off = measured(hole, np.add(hole.centre, [0, 40, 0.3]))
    outcomes = [off if outcome.hole_id == "BP4" else outcome for outcome in body(papers)]
    feature = by_id(judge_body(papers, outcomes))["BP4"]
    assert feature.verdict == "in_tolerance"
    assert set(feature.deviation) == set(feature.nominal) == set(feature.tolerance) == set("xzd")
    assert set(feature.measured) == set(feature.uncertainty) == set("xyzd")
    assert feature.deviation["z"] == pytest.approx(0.3)
    assert feature.measured["y"] == pytest.approx(hole.centre[1] + 40)


@pytest.mark.parametrize(("axis", "shift"), [("x", 2.01), ("z", -2.01), ("d", 0.21)])
def test_one_axis_beyond_its_tolerance_fails_hole_and_body(papers, axis, shift):
    hole = papers.hole("BP2")
    gap = np.zeros(4)
    gap["xyzd".index(axis)] = shift
    bad = measured(hole, hole.centre + gap[:3], hole.diameter + gap[3])
    result = judge_body(papers, [bad if o.hole_id == "BP2" else o for o in body(papers)])
    feature = by_id(result)["BP2"]
    assert result.verdict == feature.verdict == "out_of_tolerance"
    assert [a for a, said in feature.axis_verdicts.items() if said != "in_tolerance"] == [axis]


def test_deviation_parts_into_plane_and_normal(papers):
    hole = papers.hole("BP1")
    across = np.cross(hole.normal, [0, 0, 1])
    across /= np.linalg.norm(across)
    centre = hole.centre + 0.3 * across - 0.7 * hole.normal
    feature = by_id(judge_body(papers, [measured(hole, centre)]))["BP1"]
    assert feature.in_plane == pytest.approx(0.3)
    assert feature.along_normal == pytest.approx(-0.7)
    assert feature.true_position == pytest.approx(0.6)


def test_the_bias_is_against_the_master_body_not_the_drawing(papers):
    hole = dataclasses.replace(papers.hole("BP1"), cmm={"x": papers.hole("BP1").centre[0] + 0.2,
                                                        "d": 16.1}, cmm_u=0.005)
    papers = dataclasses.replace(papers, holes=(hole, *papers.holes[1:]))
    feature = by_id(judge_body(papers, [measured(hole, np.add(hole.centre, [0.25, 0, 0]))]))["BP1"]
    assert feature.bias == {"x": pytest.approx(0.05), "d": pytest.approx(-0.1)}
    assert feature.deviation["x"] == pytest.approx(0.25)


def test_what_is_not_measured_is_a_result_and_leaves_the_body_incomplete(papers):
    outcomes = [NotMeasured("BP1", "no_edge", "no hole in the picture") if o.hole_id == "BP1" else o
                for o in body(papers)[:-1]]
    result = judge_body(papers, outcomes)
    assert result.verdict == "incomplete"
    missed = by_id(result)["BP1"]
    assert (missed.verdict, missed.reason, missed.measured) == ("not_measured", "no_edge", None)
    assert by_id(result)[papers.holes[-1].id].reason == "not_reached"


def test_a_bad_hole_outweighs_a_missing_one(papers):
    hole = papers.hole("BP2")
    result = judge_body(papers, [measured(hole, np.add(hole.centre, [3, 0, 0]))])
    assert result.verdict == "out_of_tolerance"


@pytest.mark.parametrize(("deviation", "simple", "guarded"), [
    (0.0, "in_tolerance", "in_tolerance"),
    (0.40, "in_tolerance", "in_tolerance"),
    (0.43, "in_tolerance", "uncertain"),  # g = 1.645 x 0.05 = 0.082
    (-0.43, "in_tolerance", "uncertain"),
    (0.51, "out_of_tolerance", "uncertain"),
    (0.57, "out_of_tolerance", "uncertain"),
    (-0.59, "out_of_tolerance", "out_of_tolerance"),
])
def test_the_guard_band_is_that_of_iso_14253(deviation, simple, guarded):
    assert judge_axis(deviation, 0.5, 0.05, Decision(rule="simple")) == simple
    assert judge_axis(deviation, 0.5, 0.05, Decision(rule="guarded")) == guarded


def test_a_guard_band_wider_than_the_tolerance_accepts_nothing():
    assert judge_axis(0.0, 0.05, 0.05, Decision(rule="guarded")) == "uncertain"
    assert judge_axis(0.0, 0.1, 0.05, Decision(rule="guarded", confidence=0.95)) == "in_tolerance"
    assert judge_axis(0.0, 0.1, 0.05, Decision(rule="guarded", confidence=0.99)) == "uncertain"


def test_the_proof_of_conformity_errs_as_often_as_its_confidence_says():
    rng = np.random.default_rng(7)
    seen = 0.5 + rng.normal(0, 0.05, 20_000)  # a true value just on the limit
    accepted = [judge_axis(value, 0.5, 0.05, Decision(rule="guarded")) == "in_tolerance"
                for value in seen]
    assert np.mean(accepted) == pytest.approx(0.05, abs=0.006)


def test_an_uncertain_hole_leaves_the_body_uncertain(papers):
    papers = with_job(papers, decision=Decision(rule="guarded"))
    hole = papers.hole("BP2")
    near = measured(hole, np.add(hole.centre, [1.97, 0, 0]))
    result = judge_body(papers, [near if o.hole_id == "BP2" else o for o in body(papers)])
    assert result.verdict == by_id(result)["BP2"].verdict == "uncertain"
