import dataclasses

import numpy as np
import pytest

from cell.core.documents.job import Alignment, Decision, Thermal
from cell.core.documents.offsets import Offset, OffsetsDocument
from cell.core.documents.record import Attempt, HoleRecord, Start
from cell.core.documents.result import Located, Measured, NotMeasured
from cell.core.geometry import Transform
from cell.core.observation import Observation, View
from cell.metrology.decide import Circumstances, judge_axis, judge_body, judge_run

DISPLACED = Transform.from_parts([0.0005, -0.0008, 0.001], [2.3, -1.4, 0.8])
SIGMA = 0.05


@pytest.fixture
def papers(workplace):
    return workplace.papers()


def with_job(papers, **fields):
    return dataclasses.replace(papers, job=papers.job.model_copy(update=fields))


def measured(hole, centre, diameter=None, sigma=SIGMA):
    located = Located("joint", np.array([0.0, 0.0, 242.0]), hole.radius, None, np.eye(4))
    return Measured(hole.id, np.asarray(centre, float), diameter or hole.diameter,
                    np.eye(4) * sigma**2, hole.normal, located, located, 0)


def body(papers, body_from_nominal=None, noise=0.0, seed=1):
    """Outcomes of a body that is displaced as a whole, and each of its holes a little."""
    rng = np.random.default_rng(seed)
    moved = body_from_nominal or Transform.identity()
    return [measured(hole, moved @ (hole.centre + rng.normal(0, noise, 3)))
            for hole in papers.holes]


def by_id(result):
    return {feature.id: feature for feature in result.features}


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


BEST_FIT = Alignment(method="best_fit", limit_mm=8.0, datums=dict.fromkeys(
    ("BP5", "SI1", "SI5", "AP1", "RR1", "QP1"), "xyz"))
RPS = Alignment(method="rps", limit_mm=8.0, datums={"SI1": "yz", "SI5": "xyz", "RR3": "y"})


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
