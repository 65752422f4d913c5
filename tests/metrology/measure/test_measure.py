"""From an observation to the body frame: reached poses, faces, several views, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from made_observations import BASE_FROM_BODY, FLANGE_FROM_CAMERA, Sight, made_calibration
from made_pairs import SENSOR, draw_scene

from cell.core.documents.result import Measured, NotMeasured
from cell.core.geometry import Transform
from cell.metrology.measure.body_frame import reached
from cell.metrology.measure.hole import measure_hole

CALIBRATION = made_calibration()
SIGMA = 0.0061
OFF = np.array([0.4, -0.3, 0.5])


@pytest.fixture(scope="module")
def sight():
    rng = np.random.default_rng(21)
    return Sight(draw_scene(rng, radius=5.0, tilt_deg=2.0, offset=1.0), OFF)


@pytest.fixture(scope="module")
def views(sight):
    return sight.attempt(np.random.default_rng(22))


def measure(sight, observation, method="joint", calibration=CALIBRATION):
    return measure_hole(observation, sight.hole, calibration, method, SIGMA)


def within(outcome, truth, k=3.0):
    error = outcome.centre - truth
    return bool((np.abs(error) < k * np.sqrt(np.diag(outcome.covariance)[:3])).all())


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_the_hole_is_found_where_it_is_and_not_where_the_plan_has_it(sight, views, method):
    outcome = measure(sight, sight.observe(views), method)
    assert isinstance(outcome, Measured)
    assert within(outcome, sight.centre_in_body)
    assert np.linalg.norm(outcome.centre - sight.centre_in_body) < 0.1
    assert outcome.diameter == pytest.approx(10.0, abs=0.04)
    assert outcome.reference == 0
    assert outcome.two_step.method == "two-step"
    assert outcome.located.method == method


def test_the_joint_estimate_is_near_the_truth(sight, views):
    outcome = measure(sight, sight.observe(views))
    assert np.linalg.norm(outcome.centre - sight.centre_in_body) < 0.025
    assert outcome.normal @ sight.normal_in_body > np.cos(np.radians(0.5))


def test_a_nominal_on_the_back_is_reached_through_the_sheet(sight, views):
    behind = replace(sight, side="back")
    outcome = measure(behind, behind.observe(views))
    through = sight.centre_in_body - sight.scene.sheet.thickness * sight.normal_in_body
    assert np.linalg.norm(outcome.centre - through) < 0.03
    assert outcome.normal @ sight.normal_in_body < -0.99
    assert outcome.budget["face"][0] >= 0.0


def test_the_budget_adds_up_in_the_body_frame(sight, views):
    outcome = measure(sight, sight.observe(views))
    squares = np.sum(np.square(list(outcome.budget.values())), axis=0)
    assert squares == pytest.approx(np.diag(outcome.covariance))
    assert {"hand_eye", "robot"} <= set(outcome.budget)
    turn = (BASE_FROM_BODY.inverse @ reached(views[0]) @ FLANGE_FROM_CAMERA).rotation
    bare = measure(sight, sight.observe(views), calibration=made_calibration(covariances=False))
    assert bare.covariance[:3, :3] == pytest.approx(
        turn @ bare.located.covariance[:3, :3] @ turn.T)
    assert bare.covariance[3, 3] == pytest.approx(4.0 * bare.located.covariance[3, 3])
    added = np.diag(outcome.covariance - bare.covariance)[:3]
    assert added == pytest.approx(np.full(3, 0.01**2 + 0.02**2), rel=0.5)


def test_the_mean_of_the_poses_before_and_after_counts(sight, views):
    drift = Transform.from_parts([0.0, 0.0, 1e-4], [0.0, 0.01, 0.0])
    moved = tuple(replace(view, base_from_flange_after=view.base_from_flange_before @ drift,
                          base_from_flange_before=view.base_from_flange_before @ drift.inverse)
                  for view in views)
    still = measure(sight, sight.observe(views))
    outcome = measure(sight, sight.observe(moved))
    assert outcome.centre == pytest.approx(still.centre, abs=1e-6)


@pytest.mark.parametrize("light", ["ring", "laser"])
def test_an_arm_that_moved_between_the_exposures_is_refused(sight, views, light):
    step = Transform.from_parts(np.zeros(3), [0.0, 0.1, 0.0])
    moved = tuple(replace(view, base_from_flange_after=step @ view.base_from_flange_after)
                  if view.light == light else view for view in views)
    outcome = measure(sight, sight.observe(moved))
    assert isinstance(outcome, NotMeasured)
    assert outcome.reason == "arm_moved"


def test_a_stripe_from_a_first_attempt_joins_in(sight, views):
    rng = np.random.default_rng(23)
    again = sight.attempt(rng, number=1, camera_shift=(1.6, -0.3, 0.2))
    alone = measure(sight, sight.observe(again))
    both = measure(sight, sight.observe(views, again))
    assert both.reference == 2
    assert np.linalg.norm(both.centre - sight.centre_in_body) < 0.02
    assert both.covariance[:3, :3].trace() < alone.covariance[:3, :3].trace()


def test_a_laser_view_of_its_own_joins_in(sight, views):
    aside = sight.view("laser", np.random.default_rng(24), camera_shift=(2.0, 0.0, 0.0))
    one = measure(sight, sight.observe(views))
    two = measure(sight, sight.observe((*views, aside)))
    assert np.linalg.norm(two.centre - sight.centre_in_body) < 0.02
    assert two.located.covariance[2, 2] < one.located.covariance[2, 2]


def missed_and_again(sight):
    rng, plane = np.random.default_rng(25), SENSOR.light_plane
    beside = plane.normal * (plane.distance(sight.scene.centre) - 5.6)
    return (sight.attempt(rng, camera_shift=beside),
            sight.attempt(rng, number=1, camera_shift=(0.6, -0.3, 0.2)))


def test_a_first_stripe_that_missed_the_hole_joins_in_all_the_same(sight):
    missed, again = missed_and_again(sight)
    first = measure(sight, sight.observe(missed))
    assert isinstance(first, NotMeasured)
    assert first.reason == "laser_misses_hole"
    alone, both = (measure(sight, sight.observe(*seen)) for seen in ((again,), (missed, again)))
    assert both.reference == 2
    assert within(both, sight.centre_in_body)
    assert np.linalg.norm(both.centre - sight.centre_in_body) < 0.02
    assert both.located.covariance[2, 2] < alone.located.covariance[2, 2]
    assert max(both.budget["normal_prior"][:3]) < 0.7 * max(alone.budget["normal_prior"][:3])


def test_a_stripe_that_lies_off_the_sheet_does_not_join_in(sight):
    missed, again = missed_and_again(sight)
    away = Transform.from_parts(np.zeros(3), 3.0 * (BASE_FROM_BODY.turn(sight.normal_in_body)))
    deeper = tuple(replace(view, base_from_flange_before=away @ view.base_from_flange_before,
                           base_from_flange_after=away @ view.base_from_flange_after)
                   for view in missed)
    alone, both = (measure(sight, sight.observe(*seen)) for seen in ((again,), (deeper, again)))
    assert both.centre == pytest.approx(alone.centre, abs=1e-12)


def test_an_older_attempt_counts_where_the_newest_shows_nothing(sight, views):
    black = tuple(replace(view, image=np.zeros_like(view.image), attempt=1) for view in views)
    outcome = measure(sight, sight.observe(views, black))
    assert isinstance(outcome, Measured)
    assert outcome.reference == 0


@pytest.mark.parametrize("kept", [(), ("ring",), ("laser",)])
def test_missing_views_are_a_refusal_and_no_crash(sight, views, kept):
    outcome = measure(sight, sight.observe([view for view in views if view.light in kept]))
    assert isinstance(outcome, NotMeasured)
    assert outcome.reason in ("no_hole", "no_laser")


def test_the_same_observation_gives_the_same_bits(sight, views):
    first, second = (measure(sight, sight.observe(views)) for _ in range(2))
    assert first.centre.tobytes() == second.centre.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()
