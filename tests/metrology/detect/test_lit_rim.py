"""Holes before something lit: dark rings, soft shadows, bright spots that look like a hole."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from drawn_pictures import Scene
from ray_traced.pairs import render
from ray_traced.scenes import draw_scene

from cell.core.documents.calibration import SensorDocument
from cell.core.documents.text import parse
from cell.core.errors import UnmeasurableError
from cell.metrology.detect.band import sample_band, smooth_around, spread
from cell.metrology.detect.edges import find_edges
from cell.metrology.detect.ellipse import Ellipse, project_circle
from cell.metrology.detect.pair import detect_pair
from cell.metrology.detect.profile import Profile, compare
from cell.metrology.detect.ridge import find_ridges
from cell.metrology.detect.rim_fit import agree_between
from cell.metrology.detect.stripe import ends_at, gaps
from cell.metrology.features import Expected

KNOWN = pytest.mark.parametrize("known", [True, False], ids=["nominals", "nothing known"])


def outline(scene):
    """The true rim in the picture."""
    return Ellipse.through(scene.outline())


@cache
def traced(seed, difficulty):
    """A ray-traced pair with a sheet close behind: pictures, sensor, plan and the true rim."""
    pair = render(draw_scene(seed, difficulty, ("back",)))
    sensor, truth = parse(SensorDocument, pair.sensor.as_yaml(), "sensor").model, pair.truth
    plan = truth["nominal"]
    expected = Expected(normal=np.array(plan["normal"]), radius=plan["radius_mm"],
                        thickness=plan["thickness_mm"])
    rim = project_circle(sensor.camera, np.array(truth["centre_mm"]), np.array(truth["normal"]),
                         truth["radius_mm"])
    return pair, sensor, expected, rim


@pytest.mark.parametrize("difficulty", ["easy", "medium", "hard"])
@pytest.mark.parametrize("seed", range(7000, 7008))
@KNOWN
def test_the_rim_and_no_spot_or_shadow_is_found_before_a_lit_sheet(seed, difficulty, known):
    pair, sensor, expected, true = traced(seed, difficulty)
    rim, _ = detect_pair(pair.hole, pair.stripe, sensor, expected if known else Expected())
    assert np.hypot(*(np.array(rim.ellipse[:2]) - true.centre)) < 1.0
    assert abs(np.mean(rim.ellipse[2:4]) - true.radius) < 1.0 + rim.ambiguity


@pytest.mark.parametrize("behind", [90.0, 120.0, 140.0, 200.0])
@KNOWN
def test_before_something_like_the_sheet_the_wall_is_a_dark_ring(behind, known):
    scene = Scene(tilt=(4.0, -3.0), thickness=1.5, behind=behind, wall=10.0)
    rim, _ = detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor,
                         scene.expected() if known else Expected())
    assert np.hypot(*(np.array(rim.ellipse[:2]) - outline(scene).centre)) < 0.3


def test_where_only_half_of_a_rim_shows_the_plan_makes_up_for_the_rest():
    scene = Scene(tilt=(4.0, -3.0), thickness=1.5, behind=130.0, wall=10.0)  # as the sheet
    rim, _ = detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor, scene.expected())
    assert np.hypot(*(np.array(rim.ellipse[:2]) - outline(scene).centre)) < 0.3
    assert rim.quality["coverage"] < 0.8


@pytest.mark.parametrize("spot", [250.0, 20.0], ids=["bright", "dark"])
def test_a_soft_spot_behind_the_hole_is_not_its_rim(spot):
    scene = Scene(tilt=(3.0, -2.0), behind=110.0, wall=10.0)
    image, true = scene.hole_image(), outline(scene)
    disc = np.zeros(image.shape, np.float32)
    cv2.circle(disc, tuple(round(c) for c in true.centre), int(0.55 * true.radius), 1.0, -1)
    share = cv2.GaussianBlur(disc, (0, 0), 2.5)
    lit = ((1.0 - share) * image + share * spot).round().astype(np.uint8)
    rim, _ = detect_pair(lit, scene.stripe_image(), scene.sensor, Expected())
    assert np.hypot(*(np.array(rim.ellipse[:2]) - true.centre)) < 0.3
    assert np.mean(rim.ellipse[2:4]) == pytest.approx(true.radius, abs=0.7)


def test_a_hole_that_is_partly_covered_before_something_lit_is_refused():
    scene = Scene(tilt=(3.0, -2.0), behind=60.0, wall=10.0, cover=0.4)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor, scene.expected())
    assert refused.value.reason == "half_occluded"


@KNOWN
def test_a_hole_out_of_focus_is_no_lit_one(known):
    scene = Scene(blur=7.0, behind=20.0)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor,
                    scene.expected() if known else Expected())
    assert refused.value.reason == "blurred"


def test_a_stripe_ends_at_the_rim_and_at_nothing_smaller():
    scene = Scene(behind=60.0)
    ridge, true = find_ridges(scene.stripe_image(), upright=True)[0], outline(scene)
    ends = gaps(ridge, 16)[0]
    assert np.abs(true.reach(ends) - 1.0).max() * true.radius < 2.0
    assert ends_at(ridge, true, 12.0)
    assert not ends_at(ridge, true.scaled(0.5), 12.0)


@pytest.mark.parametrize(("sloped", "backlight"), [(False, False), (True, False), (False, True)])
def test_a_profile_changes_as_its_slopes_say(sloped, backlight):
    rng, offsets = np.random.default_rng(1), np.arange(-8.0, 6.0)
    profile = Profile(np.array([0.3, -0.2, 0.1]), 1.3, np.array([2.0, 1.0, 0.5]),
                      np.array([0.3, 0.1, 0.8]), sloped, backlight)
    grey = 60.0 + 50.0 * np.tanh(offsets / 2.0) + rng.normal(0.0, 5.0, (3, len(offsets)))

    def unexplained(change, by):
        moved = replace(profile, **{change: getattr(profile, change) + by})
        return 0.5 * len(offsets) * compare(offsets, grey, moved).misfit ** 2

    pulls = compare(offsets, grey, profile).pulls
    for number, change in enumerate(("edge", "blur", "width", "shade")):
        falls = (unexplained(change, -1e-4) - unexplained(change, 1e-4)) / 2e-4
        assert pulls[:, number] == pytest.approx(falls, rel=1e-4, abs=1e-3)


def test_levels_that_made_a_profile_are_found_again():
    offsets, step = np.arange(-9.0, 6.0), 1e-3
    sharp = Profile(np.zeros(1), step, np.array([2.5]), np.array([0.1]), sloped=True)
    grey = np.select([offsets < -2.5, offsets < 0.0], [70.0 - 4.0 * offsets, 9.0], 90.0)[None]
    grey[0, offsets == 0.0] = (9.0 + 90.0) / 2.0
    seen = compare(offsets, grey, sharp)
    assert seen.levels[0] == pytest.approx([70.0, 90.0], abs=0.01)
    assert seen.misfit[0] < 0.01


def test_of_two_rings_the_one_through_the_ends_is_followed():
    image = np.full((200, 200), 100, np.uint8)
    for radius in (40, 52):
        cv2.circle(image, (100 * 16, 96 * 16), radius * 16, 20, 2, cv2.LINE_AA, 4)
    start = Ellipse.circle(101.0, 95.0, 46.0)
    band = sample_band(smooth_around(image, start, 20.0), start, spread(14.0, 0.75), 120)
    edges = find_edges(band, 0, 3.0)
    for radius in (40.0, 52.0):
        aside = np.sqrt(radius**2 - 10.0**2)
        ends = np.array([[110.0, 96.0 - aside], [110.0, 96.0 + aside]])
        ellipse, miss = agree_between(band, edges, 1.0, ends, 3.0)
        assert ellipse.radius == pytest.approx(radius, abs=2.0)
        assert edges[np.abs(miss) < 2.0].rays(120).all()
