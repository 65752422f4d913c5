"""The joint estimate on exact and on noisy points: right, unbiased, and honest about itself."""

from dataclasses import replace

import numpy as np
import pytest
from made_points import (
    CAMERA,
    SENSOR_A,
    SENSOR_B,
    Noise,
    TrueHole,
    make_pair,
    make_rim,
    make_stripe,
    plan_of,
    tilted,
    waver,
)

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Plane, Transform
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.features import Expected
from cell.metrology.locate.joint import locate_joint
from cell.metrology.locate.joint_rows import Circle, Sight, StripeSight, rim_rows, stripe_rows

EXACT = Noise()
SAME = Transform.identity()


def located(hole, sensor, expected, noise=EXACT, seed=0):
    rim, stripe = make_pair(hole, sensor, noise, np.random.default_rng(seed))
    return locate_joint(rim, [(stripe, SAME)], sensor, expected)


@pytest.mark.parametrize("sensor", [SENSOR_A, SENSOR_B])
@pytest.mark.parametrize(("b", "g"), [(0.0, 0.0), (3.0, -2.0), (-8.0, 5.0), (10.0, 10.0)])
def test_a_tilted_hole_is_located_exactly_when_its_normal_is_known(sensor, b, g):
    centre = np.array([1.2, -2.3, sensor.working_distance + 1.7])
    hole = TrueHole(centre, tilted(b, g), 6.3)
    for way in (1.0, -1.0):
        found = located(hole, sensor, Expected(normal=way * hole.normal, radius=6.35))
        assert found.centre == pytest.approx(hole.centre, abs=2e-4)
        assert found.radius == pytest.approx(6.3, abs=1e-4)
        assert found.normal == pytest.approx(hole.normal, abs=2e-4)


def test_a_tilt_along_the_stripe_is_seen_whatever_the_plan_says():
    hole = TrueHole(np.array([0.5, 1.0, 253.0]), tilted(2.0, 3.0), 6.0)
    plan = Expected(normal=tilted(2.0, 2.4), normal_sigma=np.radians(0.5), radius=6.0)
    found = located(hole, SENSOR_B, plan, Noise(0.03, 0.1))
    assert found.normal[1] == pytest.approx(hole.normal[1], abs=1e-3)


def test_derivatives_are_those_of_the_residuals():
    """Away from the solution, with a stripe seen from elsewhere."""
    rng = np.random.default_rng(2)
    hole = TrueHole(np.array([1.0, 2.0, 252.0]), tilted(4.0, -3.0), 5.0)
    rim, stripe = make_pair(hole, SENSOR_B, EXACT, rng)
    pose = Transform.from_parts([0.01, -0.02, 0.03], [3.0, 1.0, -2.0])
    sight = Sight.of(rim, CAMERA)
    crossing = StripeSight.of(stripe, SENSOR_B, pose)
    tangents = np.linalg.svd(hole.normal[None])[2][1:]
    circle = Circle(hole.centre, hole.normal, tangents, np.array([1e-4, -1e-4]), 5.0001,
                    1e-4 * np.arange(1.0, 7.0), np.array([0.01]))
    far = Circle(pose @ hole.centre, pose.turn(hole.normal), pose.turn(tangents), np.zeros(2),
                 5.0, np.zeros(6), np.array([0.01]))
    for rows, at in ((lambda c: rim_rows(c, sight), circle),
                     (lambda c: stripe_rows(c, crossing, 0), far)):
        found = rows(at).jacobian
        for unknown, step in enumerate(1e-6 * np.eye(13)):
            change = rows(at.moved(step)).residual - rows(at.moved(-step)).residual
            assert found[:, unknown] == pytest.approx(change / 2e-6, rel=2e-3, abs=2e-2)


def test_noise_does_not_pull_the_tilt():
    """Points that carry noise must not be where the equations are differentiated."""
    rng = np.random.default_rng(6)
    hole = TrueHole(np.array([0.0, 0.0, 253.0]), tilted(0, 0), 5.0)
    plan = Expected(normal=hole.normal, normal_sigma=np.radians(1.2), radius=5.0)
    turns = []
    for _ in range(40):
        rim, stripe = make_pair(hole, SENSOR_B, Noise(0.05, 0.2), rng)
        turns.append(locate_joint(rim, [(stripe, SAME)], SENSOR_B, plan).normal[:2])
    assert np.abs(np.mean(turns, axis=0)).max() < np.radians(0.02)


@pytest.mark.parametrize("crests", [2, 3, 4])
def test_a_wave_of_the_rim_is_no_tilt(crests):
    """Nothing is known of the normal; the noise is far below the wave."""
    rng = np.random.default_rng(8)
    hole = TrueHole(np.array([2.0, 1.0, 252.0]), tilted(3.0, -2.0), 6.0)
    rim, stripe = make_pair(hole, SENSOR_B, Noise(0.01, 0.05), rng)
    outward = rim.points - rim.points.mean(axis=0)
    turn = np.arctan2(*outward.T[::-1])
    wavy = replace(rim, points=rim.points
                   - 0.05 * np.cos(crests * turn + 0.7)[:, None] * rim.directions)
    for seen in (rim, wavy):
        found = locate_joint(seen, [(stripe, SAME)], SENSOR_B, Expected())
        off = np.append(found.centre - hole.centre, found.radius - hole.radius)
        assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diag(found.covariance)))


@pytest.mark.parametrize("radius", [3.0, 8.0])
def test_errors_agree_with_the_uncertainty_over_scenes(radius):
    rng = np.random.default_rng(11)
    ratios = []
    while len(ratios) < 60:
        centre = np.array([0, 0, 253.0]) + rng.uniform(-4, 4, 3)
        hole = TrueHole(centre, tilted(*rng.normal(0, 2, 2)), radius)
        if abs(hole.distance(SENSOR_B.light_plane)) > 0.7 * radius:
            continue
        noise = Noise(0.1, 0.2, 0.004, 0.05)
        rim, stripe = make_pair(hole, SENSOR_B, noise, rng)
        found = locate_joint(rim, [(stripe, SAME)], SENSOR_B, plan_of(hole, 0.0061, rng))
        error = np.append(found.centre - hole.centre, found.radius - radius)
        ratios.append(np.abs(error) / np.sqrt(np.diag(found.covariance)))
    assert np.mean(np.array(ratios) < 2.0) > 0.93
    assert np.mean(np.array(ratios) < 3.0) > 0.985
    assert np.median(np.array(ratios)[:, 2]) > 0.4  # not blown up where it matters


def test_without_a_plan_the_answer_is_still_within_its_uncertainty():
    rng = np.random.default_rng(12)
    ratios = []
    while len(ratios) < 12:
        centre = np.array([0, 0, 253.0]) + rng.uniform(-3, 3, 3)
        hole = TrueHole(centre, tilted(*rng.uniform(-8, 8, 2)), 6.0)
        if abs(hole.distance(SENSOR_B.light_plane)) > 4.0:
            continue
        found = located(hole, SENSOR_B, Expected(), Noise(0.05, 0.2, 0.004, 0.03), len(ratios))
        ratios.append((found.centre - hole.centre) / np.sqrt(np.diag(found.covariance)[:3]))
    assert np.abs(ratios).max() < 3.0


def test_an_oval_hole_is_not_taken_for_a_tilt():
    """Four micrometres of ovality would fake a tilt of degrees on a circle that must be round."""
    rng = np.random.default_rng(13)
    hole = TrueHole(np.array([1.5, 0.0, 253.0]), tilted(1.0, 0.0), 5.0)
    rim, stripe = make_pair(hole, SENSOR_B, Noise(0.02, 0.05), rng)
    middle = CAMERA.project(hole.centre)
    spokes = rim.points - middle
    angle = np.arctan2(spokes[:, 1], spokes[:, 0])
    oval = replace(rim, points=middle + spokes * (1 + 0.004 / 5.0 * np.cos(2 * angle))[:, None])
    plan = Expected(normal=hole.normal, normal_sigma=np.radians(0.35), radius=5.0)
    found = locate_joint(oval, [(stripe, SAME)], SENSOR_B, plan)
    assert np.arccos(found.normal @ hole.normal) < np.radians(0.25)
    assert abs(found.centre[2] - hole.centre[2]) < 0.012


def test_a_second_stripe_from_elsewhere_settles_the_tilt():
    rng = np.random.default_rng(14)
    hole = TrueHole(np.array([1.8, -0.5, 253.5]), tilted(3.0, 1.0), 6.0)
    pose = Transform.from_parts([0.002, -0.003, 0.001], [-7.0, 0.4, 0.3])
    there = TrueHole(pose.inverse @ hole.centre, pose.inverse.turn(hole.normal), 12.0)
    plan = Expected(normal=waver(hole.normal, 0.03, rng), normal_sigma=0.03, radius=6.0)
    noise = Noise(0.05, 0.1)
    rim, stripe = make_pair(hole, SENSOR_B, noise, rng)
    second = make_stripe(there, SENSOR_B, noise, rng)
    one = locate_joint(rim, [(stripe, SAME)], SENSOR_B, plan)
    both = locate_joint(rim, [(stripe, SAME), (second, pose)], SENSOR_B, plan)
    assert np.sqrt(both.covariance[2, 2]) < 0.3 * np.sqrt(one.covariance[2, 2])
    assert np.linalg.norm(both.centre - hole.centre) < 0.004
    assert np.arccos(min(1.0, both.normal @ hole.normal)) < np.radians(0.05)


def test_a_short_arc_leans_on_the_plans_radius():
    rng = np.random.default_rng(15)
    hole = TrueHole(np.array([0.5, -0.5, 253.0]), tilted(1.0, -1.0), 5.0)
    rim = make_rim(hole, Noise(0.3), rng, arc=(0.3, 0.3 + 2 * np.pi / 3))
    stripe = make_stripe(hole, SENSOR_B, Noise(0.3), rng)
    plan = Expected(normal=hole.normal, radius=5.03)
    with_plan = locate_joint(rim, [(stripe, SAME)], SENSOR_B, plan)
    without = locate_joint(rim, [(stripe, SAME)], SENSOR_B, replace(plan, radius=None))
    assert np.linalg.norm(with_plan.centre - hole.centre) < 0.06
    assert with_plan.covariance[3, 3] < without.covariance[3, 3]


def test_a_wrong_sensor_is_covered_by_its_covariance():
    """Light plane and intrinsics drawn from what the calibration says of itself."""
    rng = np.random.default_rng(16)
    spread = np.array([0.7, 0.7, 0.4, 0.4, 0.01, 0.2, 2e-4, 2e-4, 0.0])
    lean, shift = 2e-4, 0.03
    plane_covariance = np.diag([lean**2, lean**2, lean**2, (lean * 90.0) ** 2 + shift**2])
    ratios = []
    for seed in range(40):
        off = spread * rng.normal(size=9)
        matrix = CAMERA.matrix + np.array([[off[0], 0, off[2]], [0, off[1], off[3]], [0, 0, 0]])
        light = SENSOR_B.light_plane
        plane = Plane.from_coefficients(
            np.append(light.normal, light.offset) + np.sqrt(np.diag(plane_covariance))
            * rng.normal(size=4))
        believed = SensorModel(CameraModel((768, 576), matrix, CAMERA.distortion + off[4:]), plane,
                               np.diag(spread**2), plane_covariance)
        hole = TrueHole(np.array([1.0, -2.0, 252.0]), tilted(*rng.normal(0, 2, 2)), 5.0)
        rim, stripe = make_pair(hole, SENSOR_B, Noise(0.05, 0.1), np.random.default_rng(seed))
        found = locate_joint(rim, [(stripe, SAME)], believed, plan_of(hole, 0.0061, rng))
        ratios.append((found.centre - hole.centre) / np.sqrt(np.diag(found.covariance)[:3]))
    assert {"light_plane", "intrinsics"} <= set(found.budget)
    assert np.mean(np.abs(ratios) < 2.0) > 0.88
    assert 0.3 < np.median(np.abs(ratios)) < 1.0


@pytest.mark.parametrize(("plan", "reason"), [
    ({"radius": 8.0}, "radius_against_nominal"),
    ({"normal": tilted(6, 6)}, "tilt_against_nominal")])
def test_what_contradicts_the_plan_is_refused(plan, reason):
    hole = TrueHole(np.array([1.0, -2.0, 252.0]), tilted(0, 0), 5.0)
    with pytest.raises(UnmeasurableError) as refused:
        located(hole, SENSOR_B, Expected(**plan), Noise(0.05, 0.1))
    assert refused.value.reason == reason
