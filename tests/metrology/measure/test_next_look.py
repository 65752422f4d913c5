"""The ladder of tries: what is done next, and that it ends; the camera's shift is followed."""

from dataclasses import replace

import numpy as np
import pytest
from made_observations import Sight, made_calibration
from made_pairs import SENSOR, draw_scene

from cell.core.documents.job import Retry
from cell.core.documents.result import Measured, NotMeasured
from cell.metrology.measure.exposure import advise_exposure
from cell.metrology.measure.hole import measure_hole
from cell.metrology.measure.next_look import decide_next

CALIBRATION = made_calibration()
RETRY = Retry()
SIGMA = 0.0061


def sight_at(s, seed=31):
    """A hole of 5 mm whose centre lies `s` mm beside the light plane."""
    scene = draw_scene(np.random.default_rng(seed), radius=5.0, tilt_deg=2.0, offset=0.3,
                       finishes=("primer",))
    plane = SENSOR.light_plane
    shift = plane.normal * (s - plane.distance(scene.centre))
    moved = replace(scene, centre=scene.centre + shift, base_from_camera=replace(
        scene.base_from_camera, matrix=_shifted(scene.base_from_camera, -shift)))
    return Sight(moved, np.array([0.1, -0.1, 0.1]))


def _shifted(base_from_camera, shift):
    matrix = base_from_camera.matrix.copy()
    matrix[:3, 3] += base_from_camera.turn(shift)
    return matrix


def decide(sight, observation, retry=RETRY, time_left=30.0, tolerance=0.5):
    hole = replace(sight.hole, tolerance=dict.fromkeys("xyzd", tolerance))
    outcome = measure_hole(observation, hole, CALIBRATION, "joint", SIGMA)
    return outcome, decide_next(observation, outcome, hole, retry, CALIBRATION, time_left)


def test_a_centred_hole_is_accepted_at_once():
    sight = sight_at(0.3)
    outcome, look = decide(sight, sight.observe(sight.attempt(np.random.default_rng(1))))
    assert isinstance(outcome, Measured)
    assert look.action == "accept"


@pytest.mark.parametrize(("s", "tolerance"), [(3.6, 1.0), (2.5, 0.05)])
def test_far_from_the_light_or_over_budget_it_recentres_and_gains(s, tolerance):
    """The first for the short chord, the second for the tolerance's sake."""
    sight, rng = sight_at(s), np.random.default_rng(2)
    first = sight.attempt(rng)
    before, look = decide(sight, sight.observe(first), tolerance=tolerance)
    assert look.action == "recentre"
    assert np.linalg.norm(look.camera_shift) == pytest.approx(s, abs=0.1)
    second = sight.attempt(rng, 1, look.camera_shift)
    after, look = decide(sight, sight.observe(first, second), tolerance=tolerance)
    assert look.action == "accept"
    assert after.covariance[:3, :3].trace() < before.covariance[:3, :3].trace()
    distance = SENSOR.light_plane.distance(after.located.centre)
    assert abs(distance) < 0.05


def test_a_hole_beside_the_stripe_is_found_by_itself_and_centred():
    sight, rng = sight_at(-6.5), np.random.default_rng(3)
    first = sight.attempt(rng)
    outcome, look = decide(sight, sight.observe(first), Retry(recentre_limit_mm=10.0))
    assert outcome.reason == "laser_misses_hole"
    assert look.action == "recentre"
    second = sight.attempt(rng, 1, look.camera_shift)
    outcome, look = decide(sight, sight.observe(first, second))
    assert isinstance(outcome, Measured)
    assert np.linalg.norm(outcome.centre - sight.centre_in_body) < 0.03


def test_what_lies_beyond_the_limit_is_not_chased():
    sight = sight_at(-6.5)
    observation = sight.observe(sight.attempt(np.random.default_rng(3)))
    outcome, look = decide(sight, observation, Retry(recentre_limit_mm=2.0))
    assert isinstance(outcome, NotMeasured)
    assert look.action == "same_again"
    assert decide(sight, observation, Retry(recentre=False))[1].action == "same_again"


def test_the_ladder_ends():
    sight = sight_at(0.3)
    black = [tuple(replace(view, image=np.zeros_like(view.image), attempt=number)
                   for view in sight.attempt(np.random.default_rng(4))) for number in range(3)]
    actions = [decide(sight, sight.observe(*black[:count]))[1].action for count in (1, 2, 3)]
    assert actions[2] == "give_up"
    assert set(actions[:2]) <= {"same_again", "other_exposure"}
    assert "other_exposure" in actions[:2]
    assert decide(sight, sight.observe(black[0]), time_left=0.0)[1].action == "give_up"
    assert decide(sight, sight.observe(black[0]), Retry(attempts=1))[1].action == "give_up"


def test_nothing_is_chased_when_the_time_is_up():
    sight = sight_at(3.6)
    observation = sight.observe(sight.attempt(np.random.default_rng(2)))
    assert decide(sight, observation, time_left=0.0)[1].action == "accept"


def test_the_exposure_follows_the_picture_that_needs_it():
    sight, rng = sight_at(0.3), np.random.default_rng(5)
    ring, laser = sight.attempt(rng)
    dark = replace(ring, image=(ring.image * 0.2).astype(np.uint8))
    full = replace(laser, image=np.clip(laser.image * 8.0, 0, 255).astype(np.uint8))
    factor = advise_exposure(sight.observe((dark, full)))
    assert factor["ring"] > 2.0
    assert factor["laser"] < 1.0
    assert 0.25 <= min(factor.values()) <= max(factor.values()) <= 4.0
