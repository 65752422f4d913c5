"""The truth of rendered pairs lies where their pictures show it, found by plain means."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from ray_traced.detector import Lens
from ray_traced.invalid import KINDS, draw_invalid
from ray_traced.pairs import render
from ray_traced.picture import look, trace
from ray_traced.plate import FACE, RIM, WALL, Rays
from ray_traced.rims import Burr, DieRoll, Round
from ray_traced.scene import SkinPlan
from ray_traced.scenes import draw_scene
from ray_traced.sensor import PAPER, SENSORS
from ray_traced.surface import Finish
from ray_traced.varied import vary

EVEN = SkinPlan(Finish(0.5, 0.0, 0.2, 0.2, wall=0.0))  # matt, without texture; a black bore
LENS = Lens(1.4, 0.0, 0.0)  # cubic interpolation is exact enough from there on


def clean(seed, difficulty):
    """A scene with nothing but a plate, its black bore and the lights."""
    scene = draw_scene(seed, difficulty, ())
    return replace(scene, sheets=(replace(scene.sheets[0], skin=EVEN),))


def opencv_pixels(sensor, points):
    """Project points (n, 3) by OpenCV."""
    matrix = np.array([[sensor.focal[0], 0, sensor.centre[0]],
                       [0, sensor.focal[1], sensor.centre[1]], [0, 0, 1.0]])
    pixels, _ = cv2.projectPoints(points[:, None], np.zeros(3), np.zeros(3), matrix,
                                  np.array(sensor.distortion))
    return pixels[:, 0]


def half_way_out(picture, middle, edge):
    """Find where, from the middle (2,) past points of an edge (n, 2), the picture is half bright.

    Gives the distances (n,) from the points, outwards, in px.
    """
    out = (edge - middle) / np.linalg.norm(edge - middle, axis=1, keepdims=True)
    steps = np.arange(-8.0, 8.0, 0.05)
    places = edge[:, None] + steps[:, None] * out[:, None]
    grey = map_coordinates(picture, [places[..., 1], places[..., 0]], order=3)
    level = grey[:, -40:].mean(axis=1, keepdims=True) / 2.0
    first = np.argmax(grey > level, axis=1)
    rows = np.arange(len(edge))
    below, above = grey[rows, first - 1], grey[rows, first]
    return steps[first] - 0.05 * (above - level[:, 0]) / (above - below)


@pytest.mark.parametrize(("seed", "difficulty"), [(0, "easy"), (1, "medium"), (2, "hard"),
                                                  (3, "easy"), (4, "hard")])
def test_the_rim_is_half_bright_where_the_circle_is_projected(seed, difficulty):
    scene = clean(seed, difficulty)
    angle = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    circle = scene.centre + scene.radius * (
        np.cos(angle)[:, None] * scene.turn[:, 0] + np.sin(angle)[:, None] * scene.turn[:, 1])
    edge = opencv_pixels(scene.sensor, circle)
    middle = opencv_pixels(scene.sensor, scene.centre[None])[0]
    off = half_way_out(LENS.blurred(look(scene).ring), middle, edge)
    radius = np.linalg.norm(edge - middle, axis=1).mean()
    drawn_in = (LENS.blur ** 2 + 1.0 / 12.0) / (2.0 * radius)
    assert np.abs(off + drawn_in).max() < 0.02  # a blurred arc is half bright inside itself
    assert abs(off.mean() + drawn_in) < 0.002
    assert np.abs([(off * np.cos(angle)).mean(), (off * np.sin(angle)).mean()]).max() < 0.001


@pytest.mark.parametrize(("seed", "difficulty"), [(0, "easy"), (1, "medium"), (2, "hard"),
                                                  (5, "hard")])
def test_the_stripe_is_where_light_plane_and_plate_meet(seed, difficulty):
    scene = clean(seed, difficulty)
    picture = LENS.blurred(look(scene).laser)
    normal, offset = scene.sensor.laser_normal
    along = np.cross(normal, scene.turn[:, 2])
    into = np.stack([normal, scene.turn[:, 2], along])
    start = np.linalg.solve(into, [-offset, scene.turn[:, 2] @ scene.centre, 0.0])
    start = start + along * (along @ (scene.centre - start)) / (along @ along)
    line = start + np.linspace(-25.0, 25.0, 400)[:, None] * along / np.linalg.norm(along)
    pixels = opencv_pixels(scene.sensor, line)
    pixels = pixels[np.argsort(pixels[:, 1])]
    rows = 8 + np.flatnonzero(picture[8:-8].max(axis=1) > 0.5 * picture.max())
    rim = opencv_pixels(scene.sensor, scene.centre[None])[0, 1]
    rows = rows[np.abs(rows - rim) > scene.radius * 14.5 + 10.0]
    seen = (picture[rows] @ np.arange(picture.shape[1])) / picture[rows].sum(axis=1)
    off = seen - np.interp(rows, pixels[:, 1], pixels[:, 0])
    assert len(rows) > 100
    assert np.abs(off).max() < 0.005


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_the_lens_is_opencvs_and_its_rays_end_in_their_pixels(sensor):
    points = np.random.default_rng(0).uniform([-30, -20, 230], [30, 20, 260], (500, 3))
    pixels = sensor.project(points)
    assert np.abs(pixels - opencv_pixels(sensor, points)).max() < 1e-9
    assert np.abs(sensor.slopes(pixels) - points[:, :2] / points[:, 2:]).max() < 1e-12


@pytest.mark.parametrize("sides", [(True, False), (False, True), (True, True)])
def test_a_mirrored_sensor_sees_the_mirrored_world_mirrored(sides):
    mirrored = PAPER.mirrored(*sides)
    turn = np.where([*sides, False], -1.0, 1.0)
    points = np.random.default_rng(1).uniform([-30, -20, 230], [30, 20, 260], (100, 3))
    corner = np.where(sides, np.array(PAPER.size) - 1.0, 0.0)
    assert np.abs(mirrored.project(points * turn)
                  - (corner + PAPER.project(points) * turn[:2])).max() < 1e-9
    normal, offset = PAPER.laser_normal
    assert np.allclose(mirrored.laser_normal[0], normal * turn)
    assert mirrored.laser_normal[1] == pytest.approx(offset)


RIMS = [None, Burr(Round(0.08, ((3, 0.4, 1.0), (7, 0.3, 2.0)), 0.12), 1.5),
        DieRoll(Round(0.1, ((1, 0.4, 0.3),), 0.15))]


@pytest.mark.parametrize("rim", RIMS, ids=lambda rim: type(rim).__name__)
def test_rays_end_on_the_metal(rim):
    sheet = replace(draw_scene(7, "easy", ()).sheets[0], rim=rim)
    rng, hole = np.random.default_rng(2), sheet.openings[0]
    eye = np.array([20.0, -30.0, -240.0])
    ends = rng.uniform(-hole.radius - 1.0, hole.radius + 1.0, (40_000, 2))
    rays = Rays(eye, (ends - eye[:2]) / 240.0)
    _, kinds, depths = trace((sheet,), rays)
    points = rays.at(depths)
    apart = sheet.outside(points)
    face, lip, wall = (kinds == kind for kind in (FACE, RIM, WALL))
    assert face.any() and wall.any() and lip.any() == (rim is not None)
    assert np.all(depths[face] == 0.0)
    assert np.abs(depths[lip] - sheet.rim_depth(points[lip])).max(initial=0.0) < 1e-6
    assert np.abs(apart[wall]).max() < 1e-6
    assert depths[wall].min() >= (rim.span[0] if rim else 0.0)
    assert depths[wall].max() <= sheet.back
    assert lip.any() == (rim is not None) and apart[lip].max(initial=0.0) <= 1.5 * 0.15
    before = sheet.outside(rays.at(depths - 1e-4))[wall]
    assert np.all(before < 0.0)  # they came through the opening


def test_a_pair_is_its_seed():
    first, second = render(draw_scene(11)), render(draw_scene(11))
    assert np.array_equal(first.hole, second.hole) and np.array_equal(first.stripe, second.stripe)
    assert first.truth == second.truth


def test_a_varied_pair_has_its_truth_where_it_shows_it():
    scene = clean(3, "medium")
    pair = render(scene)
    for seed in range(6):
        varied = vary(pair, seed)
        truth, sensor = varied.truth, varied.sensor
        x, y = sensor.project(np.array(truth["centre_mm"]))
        dark = cv2.moments((varied.hole < varied.hole.max() / 3).astype(np.uint8), True)
        assert np.hypot(dark["m10"] / dark["m00"] - x, dark["m01"] / dark["m00"] - y) < 0.5


def test_every_kind_of_refusal_is_rendered():
    pairs = [render(draw_invalid(seed)) for seed in range(len(KINDS))]
    assert all(not pair.truth["valid"] for pair in pairs)
    assert {pair.truth["reason"] for pair in pairs} == {
        "no_hole", "no_laser", "laser_misses_hole", "slot", "not_round", "half_occluded",
        "hole_cut_by_border", "too_dark", "saturated", "blurred", "images_swapped",
        "stripe_segments_disagree"}
