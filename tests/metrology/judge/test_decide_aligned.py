"""A body judged on its datums and at 20 degrees C."""

import dataclasses

import numpy as np
import pytest
from made_outcomes import BEST_FIT, DISPLACED, RPS, SIGMA, body, by_id, measured, with_job

from cell.core.documents.job import Thermal
from cell.core.documents.result import NotMeasured
from cell.core.geometry import Transform
from cell.metrology.judge.decide import Circumstances, judge_body


@pytest.mark.parametrize("alignment", [BEST_FIT, RPS])
def test_an_alignment_takes_the_displacement_out(papers, alignment):
    displaced = body(papers, DISPLACED)
    assert judge_body(papers, displaced).verdict == "out_of_tolerance"
    result = judge_body(with_job(papers, alignment=alignment), displaced)
    assert result.verdict == "in_tolerance"
    assert max(abs(gap) for f in result.features for gap in f.deviation.values()) < 0.01
    found = Transform(np.array(result.alignment["aligned_from_body"]))
    millimetres, radians = found.distance(DISPLACED.inverse)
    assert millimetres < 0.05
    assert radians < 2e-5


def test_datums_are_on_their_nominals_along_what_they_hold(papers):
    result = judge_body(with_job(papers, alignment=RPS), body(papers, DISPLACED, noise=0.1))
    features = by_id(result)
    for hole_id, axes in RPS.datums.items():
        assert all(abs(features[hole_id].deviation[axis]) < 1e-6 for axis in axes
                   if axis in features[hole_id].deviation)
    assert abs(features["BP1"].deviation["x"]) > 1e-3


def test_a_moved_body_is_one_statement(papers):
    result = judge_body(papers, body(papers, DISPLACED, noise=0.03))
    assert "the body, the base or the sensor moved" in result.alignment["statement"]
    assert "2 mm" in result.alignment["statement"]
    assert result.alignment["rms_before_mm"] > 1.0
    assert result.alignment["rms_after_mm"] < 0.05
    centre = np.mean([hole.centre for hole in papers.holes], axis=0)
    np.testing.assert_allclose(result.alignment["rigid_shift_mm"], DISPLACED @ centre - centre,
                               atol=0.02)
    np.testing.assert_allclose(result.alignment["rigid_turn_deg"],
                               np.degrees(DISPLACED.rotation_vector), atol=0.01)


def test_a_body_that_moved_too_far_is_not_called_good_even_when_aligned(papers):
    tight = BEST_FIT.model_copy(update={"limit_mm": 1.0})
    result = judge_body(with_job(papers, alignment=tight), body(papers, DISPLACED))
    assert result.verdict == "uncertain"
    assert result.alignment["statement"]


def test_a_datum_that_the_others_do_not_bear_out_is_named(papers):
    hole = papers.hole("QP1")
    stray = measured(hole, DISPLACED @ np.add(hole.centre, [1.2, 0, -0.9]))
    outcomes = [stray if o.hole_id == "QP1" else o for o in body(papers, DISPLACED, noise=0.02)]
    tight = BEST_FIT.model_copy(update={"limit_mm": 4.0})
    assert judge_body(with_job(papers, alignment=tight), outcomes).alignment["statement"] == ""
    far = measured(hole, DISPLACED @ np.add(hole.centre, [4.0, 0, -3.0]))
    outcomes = [far if o.hole_id == "QP1" else o for o in outcomes]
    assert "the datum QP1 is off by" in judge_body(
        with_job(papers, alignment=tight), outcomes).alignment["statement"]


def test_one_bad_hole_is_no_moved_body(papers):
    hole = papers.hole("AP1")
    outcomes = [measured(hole, np.add(hole.centre, [4, 0, 0])) if o.hole_id == "AP1" else o
                for o in body(papers, noise=0.02)]
    assert judge_body(papers, outcomes).alignment["statement"] == ""


def test_a_missing_datum_leaves_a_body_unjudged_with_the_reason(papers):
    outcomes = [NotMeasured("SI5", "no_stripe", "dark") if o.hole_id == "SI5" else o
                for o in body(papers, DISPLACED)]
    result = judge_body(with_job(papers, alignment=RPS), outcomes)
    assert result.verdict == "incomplete"
    assert {feature.verdict for feature in result.features} == {"not_measured"}
    assert by_id(result)["BP1"].reason == "not_aligned"
    assert by_id(result)["SI5"].reason == "no_stripe"
    assert "without SI5" in result.alignment["problem"]


def test_a_best_fit_goes_on_without_a_datum_and_says_so(papers):
    outcomes = [o for o in body(papers, DISPLACED) if o.hole_id != "SI1"]
    result = judge_body(with_job(papers, alignment=BEST_FIT), outcomes)
    assert result.alignment["missing"] == ["SI1"]
    assert by_id(result)["BP1"].verdict == "in_tolerance"
    assert result.verdict == "incomplete"


def test_alignment_adds_to_the_uncertainty_what_its_datums_give(papers):
    displaced = body(papers, DISPLACED)
    plain = by_id(judge_body(papers, displaced))["BP1"].uncertainty
    aligned = by_id(judge_body(with_job(papers, alignment=BEST_FIT), displaced))["BP1"].uncertainty
    assert plain["x"] == pytest.approx(SIGMA)
    assert SIGMA * 1.05 < aligned["x"] < SIGMA * 1.6
    assert aligned["d"] == pytest.approx(SIGMA)


def test_alignment_takes_the_uncertainty_of_the_registration_out(papers):
    """An error of the registration moves the whole body, and so does the alignment, back."""
    known = body(papers, DISPLACED)
    wide = np.diag(np.square([0.3, 0.3, 0.3, 0.0]))
    unsure = [dataclasses.replace(hole, covariance=hole.covariance + wide,
                                  budget={"registration": (0.3, 0.3, 0.3, 0.0)}) for hole in known]
    fixture = by_id(judge_body(papers, unsure))["BP1"].uncertainty
    assert fixture["x"] == pytest.approx(np.hypot(SIGMA, 0.3))
    aligned = with_job(papers, alignment=BEST_FIT)
    one, other = (by_id(judge_body(aligned, seen))["BP1"].uncertainty for seen in (known, unsure))
    assert one == pytest.approx(other)


def test_a_warm_body_is_scaled_to_20_degrees(papers):
    steel = Thermal(expansion_per_kelvin=11.5e-6, part_temperature_c=25.0,
                    fixed_point=(1400.0, -700.0, 600.0))
    warm = [measured(hole, np.array(steel.fixed_point) + (1 + 11.5e-6 * 5) * (
        hole.centre - np.array(steel.fixed_point)), hole.diameter * (1 + 11.5e-6 * 5))
        for hole in papers.holes]
    cooled = judge_body(with_job(papers, thermal=steel), warm)
    assert max(abs(gap) for f in cooled.features for gap in f.deviation.values()) < 1e-5
    assert by_id(judge_body(papers, warm))["RR1"].deviation["z"] > 0.01


def test_a_measured_temperature_counts_before_the_entered_one(papers):
    papers = with_job(papers, thermal=Thermal(expansion_per_kelvin=1e-5, part_temperature_c=20.0))
    entered = by_id(judge_body(papers, body(papers)))["BP1"]
    warm = by_id(judge_body(papers, body(papers), Circumstances(part_temperature_c=30.0)))["BP1"]
    assert entered.deviation["x"] == pytest.approx(0.0, abs=1e-9)
    assert warm.deviation["x"] == pytest.approx(-1e-4 * papers.hole("BP1").centre[0])
