"""Is the stated uncertainty true? Errors over scenes, never repeats of one, against it.

Asked: 92 to 98 % of the errors within 2 u, at least 98 % within 3 u, and u not blown up: the median
of |error| / u between 0.4 and 0.9 for every axis.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_pairs import SENSOR, draw_scene
from made_points import SENSOR_B, Noise, TrueHole, make_pair, plan_of, tilted
from rich.console import Console
from rich.table import Table

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Transform
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.locate.joint import locate_joint
from cell.metrology.locate.pair import locate_pair
from cell.metrology.locate.uncertainty import CENTRE_DOUBT, RADIUS_DOUBT

pytestmark = [pytest.mark.bench, pytest.mark.timeout(1200)]

POINT_SCENES, RENDERED_SCENES = 2000, 2000
AXES = ("x", "y", "z", "radius")
SAME = Transform.identity()
SIGMA = 0.0061
SPREAD = np.array([0.7, 0.7, 0.5, 0.5, 0.01, 0.2, 2e-4, 2e-4, 0.0])
PLANE_SPREAD = np.diag([5e-5, 5e-5, 5e-5, 0.01]) ** 2


def show(capsys, title, errors, sigmas):
    ratios = np.abs(errors) / sigmas
    table = Table("", "rms um", "bias um", "median |e|/u", "within 2 u", "within 3 u",
                  title=f"{title}, {len(errors)} scenes")
    for axis, error, ratio in zip(AXES, errors.T, ratios.T, strict=True):
        table.add_row(axis, f"{1e3 * np.sqrt(np.mean(error**2)):.1f}", f"{1e3 * error.mean():.1f}",
                      f"{np.median(ratio):.2f}", f"{np.mean(ratio < 2):.1%}",
                      f"{np.mean(ratio < 3):.1%}")
    with capsys.disabled():
        Console(width=110).print(table)
    return ratios


def assert_true(ratios):
    """Every axis for itself keeps to what is asked."""
    within_2u, median = np.mean(ratios < 2, axis=0), np.median(ratios, axis=0)
    assert np.all((within_2u > 0.92) & (within_2u < 0.98))
    assert np.all(np.mean(ratios < 3, axis=0) > 0.98)
    assert np.all((median > 0.4) & (median < 0.9))


def wrong_sensor(rng):
    """A sensor as a calibration would believe it: off by what it says of itself."""
    off = SPREAD * rng.normal(size=9)
    matrix = SENSOR_B.camera.matrix + np.array(
        [[off[0], 0, off[2]], [0, off[1], off[3]], [0, 0, 0]])
    plane = SENSOR_B.light_plane
    lean, shift = rng.normal(0, 5e-5, 3), rng.normal(0, 0.01)
    believed = type(plane)(plane.normal + lean, plane.offset + shift)
    return SensorModel(CameraModel((768, 576), matrix, SENSOR_B.camera.distortion + off[4:]),
                       believed, np.diag(SPREAD**2), PLANE_SPREAD)


def lit_unevenly(rim, rng):
    """The rim as light and edge break displace it: off by what the budget says of them."""
    aside = rng.normal(0.0, CENTRE_DOUBT, 2)
    off = rng.normal(0.0, RADIUS_DOUBT) + rim.directions @ aside
    return replace(rim, points=rim.points + off[:, None] * rim.directions)


def test_point_scenes_with_calibration_and_edges_that_are_off(capsys):
    rng = np.random.default_rng(41)
    errors, sigmas = [], []
    while len(errors) < POINT_SCENES:
        radius = rng.uniform(2.5, 10.0)
        centre = np.array([0, 0, 253.0]) + rng.uniform(-4, 4, 3)
        hole = TrueHole(centre, tilted(*rng.normal(0, 2, 2)), radius)
        if abs(hole.distance(SENSOR_B.light_plane)) > 0.7 * radius:
            continue
        rim, stripe = make_pair(hole, SENSOR_B, Noise(0.1, 0.2, 0.004, 0.03), rng)
        rim = lit_unevenly(rim, rng)
        found = locate_joint(rim, [(stripe, SAME)], wrong_sensor(rng), plan_of(hole, SIGMA, rng))
        errors.append(np.append(found.centre - hole.centre, found.radius - radius))
        sigmas.append(np.sqrt(np.diag(found.covariance)))
    ratios = show(capsys, "Point data, calibration and edges off", np.array(errors),
                  np.array(sigmas))
    assert_true(ratios)


def test_rendered_scenes(capsys):
    """Surfaces, sheets, tilts and offsets differ; the sensor is known exactly."""
    rng = np.random.default_rng(42)
    errors, sigmas, refused = [], [], 0
    for _ in range(RENDERED_SCENES):
        scene = draw_scene(rng)
        try:
            found = locate_pair(*scene.pair(rng), SENSOR, scene.plan(rng))
        except UnmeasurableError:
            refused += 1
            continue
        errors.append(np.append(found.centre - scene.centre, found.radius - scene.radius))
        sigmas.append(np.sqrt(np.diag(found.covariance)))
    ratios = show(capsys, f"Rendered pairs ({refused} refused)", np.array(errors),
                  np.array(sigmas))
    assert refused <= 0.02 * RENDERED_SCENES
    assert_true(ratios)


def test_rendered_recentred(capsys):
    """Asked: 3D rms at most 9 um at r = 5 mm, re-centred, with speckle."""
    rng = np.random.default_rng(43)
    errors, sigmas = [], []
    for _ in range(60):
        scene = draw_scene(rng, radius=5.0, tilt_deg=0.7, offset=0.05)
        along = SENSOR.light_plane.distance(scene.centre)
        if abs(along) > 0.9:
            continue
        found = locate_pair(*scene.pair(rng), SENSOR, scene.plan(rng, np.radians(0.7)))
        errors.append(np.append(found.centre - scene.centre, found.radius - scene.radius))
        sigmas.append(np.sqrt(np.diag(found.covariance)))
    show(capsys, "Rendered, r = 5 mm, nearly centred", np.array(errors), np.array(sigmas))
    rms = np.sqrt(np.mean(np.sum(np.array(errors)[:, :3] ** 2, axis=1)))
    assert rms < 0.009
