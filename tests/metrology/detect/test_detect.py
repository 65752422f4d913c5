"""The detector on drawn pictures whose truth is known: what disturbs, and what must be refused."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from drawn_pictures import Scene, made_sensor

from cell.core.errors import UnmeasurableError
from cell.metrology.detect.band import Band
from cell.metrology.detect.edges import Edges
from cell.metrology.detect.ellipse import Ellipse, project_circle
from cell.metrology.detect.hole import detect_hole
from cell.metrology.detect.pair import detect_pair
from cell.metrology.detect.rim_fit import settle
from cell.metrology.detect.stripe import detect_stripe
from cell.metrology.features import Expected
from cell.metrology.reasons import REASONS

LYING = made_sensor(upright=False)
TILTED = {"tilt": (6.0, 5.0), "thickness": 2.0}

# name: (scene, largest centre error in px with nominals, and without)
MEASURABLE = {
    "plain": ({}, 0.05, 0.06),
    "small": ({"radius": 2.5}, 0.06, 0.06),
    "large": ({"radius": 8.0, "centre": (1.5, -1.0, 244.0)}, 0.05, 0.06),
    "brushed": ({"surface": "brushed"}, 0.08, 0.1),
    "spangled": ({"surface": "spangled"}, 0.12, 0.15),
    "uneven light": ({"gradient": 0.8}, 0.12, 0.12),
    "burr": ({"burr": 0.15}, 0.12, 0.12),
    "dark arc": ({"dark_arc": 90.0}, 0.2, 0.2),
    "glints": ({"glints": 8}, 0.1, 0.1),
    "scratches": ({"scratches": 15}, 0.1, 0.1),
    "neighbour": ({"neighbour": True, "radius": 3.0}, 0.08, 0.08),
    "bright wall": ({"wall": 70.0, **TILTED}, 0.1, 0.15),
    "dim wall": ({"wall": 25.0, **TILTED}, 0.05, 0.3),
    "a little soft": ({"blur": 2.0}, 0.1, 0.1),
    "noisy": ({"noise": 10.0}, 0.08, 0.08),
    "black": ({"plate": 30.0, "behind": 4.0, "wall": 6.0, "noise": 2.0}, 0.1, 0.1),
    "bright behind": ({"plate": 40.0, "behind": 110.0, "wall": 30.0}, 0.15, 1.0),
    "second sheet": ({"behind": 60.0, "wall": 20.0, "stripe_behind": 8.0}, 0.1, 0.12),
    "lying stripe": ({"sensor": LYING}, 0.06, 0.06),
    "blooming stripe": ({"stripe": 4000.0, "stripe_width": 4.5}, 0.05, 0.06),
    "strong tilt": ({"tilt": (9.0, -9.0)}, 0.08, 0.1),
}

REFUSED = {
    "no_hole": {"shape": "none"},
    "no_laser": {"stripe": 0.0},
    "laser_misses_hole": {"centre": (-5.2, -0.8, 244.0), "radius": 2.5},
    "slot": {"shape": "slot", "radius": 4.0},
    "not_round": {"shape": "square", "radius": 4.0},
    "half_occluded": {"cover": 0.4},
    "hole_cut_by_border": {"centre": (1.0, 10.5, 244.0)},
    "too_dark": {"plate": 6.0, "behind": 4.0, "wall": 4.0, "noise": 2.0},
    "saturated": {"plate": 600.0, "behind": 400.0, "wall": 400.0},
    "blurred": {"blur": 6.0},
    "stripe_segments_disagree": {"stripe_step": 0.8},
}

# Without a radius in mind, parts of a square can pass for parts of larger rims.
ALIKE = {"not_round": ("slot", "half_occluded", "hole_cut_by_border")}


@cache
def pictured(name: str) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A scene of the tables and its two pictures."""
    scene = moved(MEASURABLE[name][0] if name in MEASURABLE else REFUSED[name], seed=len(name))
    return scene, scene.hole_image(), scene.stripe_image()


def moved(scene: dict, seed: int) -> Scene:
    """The scene, its hole shifted by a seeded fraction of a millimetre."""
    shift = np.random.default_rng(seed).uniform(-0.2, 0.2, 3)
    centre = np.array(scene.get("centre", (0.6, -0.8, 244.0))) + shift
    return Scene(**{**scene, "centre": tuple(centre), "seed": seed})


def true_ellipse(scene: Scene) -> Ellipse:
    """The ellipse through the projected rim, by least squares along its normals."""
    points = scene.outline()
    ellipse = Ellipse.through(points)
    for _ in range(4):
        inward = (points - ellipse.centre) @ np.linalg.inv(ellipse.shape)
        t = np.arctan2(inward[:, 1], inward[:, 0])
        miss = ((points - ellipse.points(t)) * ellipse.normals(t)).sum(axis=1)
        ellipse = ellipse.moved(np.linalg.lstsq(ellipse.design(t), miss, rcond=None)[0])
    return ellipse


def off_sheet(scene: Scene, points: np.ndarray) -> np.ndarray:
    """How far stripe points lie off their true place, px across the stripe."""
    sensor = scene.sensor

    def height(pixels):
        return (sensor.light_plane.meet(sensor.camera.rays(pixels)) - scene.centre) @ scene.normal

    step = np.abs(sensor.light_plane.normal[:2]).round()
    return height(points) / (height(points + step) - height(points))


@pytest.mark.parametrize("name", MEASURABLE)
@pytest.mark.parametrize("known", [True, False], ids=["nominals", "nothing known"])
def test_rim_and_stripe_are_found(name, known):
    _, close, rough = MEASURABLE[name]
    scene, hole_image, stripe_image = pictured(name)
    expected = scene.expected() if known else Expected()
    rim, stripe = detect_pair(hole_image, stripe_image, scene.sensor, expected)
    miss = np.array(rim.ellipse[:2]) - true_ellipse(scene).centre
    assert np.hypot(*miss) < (close if known else rough)
    assert abs(off_sheet(scene, stripe.points).mean()) < 0.3
    assert set(np.unique(stripe.side)) == {-1.0, 1.0}


@pytest.mark.parametrize("reason", REFUSED)
@pytest.mark.parametrize("known", [True, False], ids=["nominals", "nothing known"])
def test_what_carries_no_measurement_is_refused(reason, known):
    scene, hole_image, stripe_image = pictured(reason)
    expected = scene.expected() if known else Expected()
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(hole_image, stripe_image, scene.sensor, expected)
    assert refused.value.reason in ({reason} if known else {reason, *ALIKE.get(reason, ())})
    assert refused.value.detail.startswith(REASONS[refused.value.reason])


def test_a_hole_of_another_size_is_named():
    scene = Scene(radius=5.0)
    wrong = replace(scene.expected(), radius=3.0)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor, wrong)
    assert refused.value.reason == "radius_against_nominal"


def test_swapped_images_are_named():
    scene = Scene()
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.stripe_image(), scene.hole_image(), scene.sensor, Expected())
    assert refused.value.reason == "images_swapped"


def test_the_stripe_behind_the_hole_is_not_taken():
    scene = Scene(behind=60.0, stripe_behind=8.0, radius=7.0)
    _, stripe = detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor,
                            scene.expected())
    inside = true_ellipse(scene).reach(stripe.points) < 1.0
    assert not inside.any()


def test_each_image_can_be_asked_alone():
    scene = Scene(tilt=(3.0, -4.0))
    expected = scene.expected()
    rim = detect_hole(scene.hole_image(), scene.sensor.camera, expected)
    stripe = detect_stripe(scene.stripe_image(), rim, scene.sensor.camera,
                           scene.sensor.light_plane, expected)
    assert len(rim.points) > 150
    assert len(stripe.points) > 100


def test_a_wrong_region_hides_the_hole():
    scene = Scene()
    elsewhere = replace(scene.expected(), centre=np.array([13.0, 11.0, 244.0]), centre_sigma=0.2)
    with pytest.raises(UnmeasurableError):
        detect_hole(scene.hole_image(), scene.sensor.camera, elsewhere)


def test_directions_point_into_the_hole_and_have_unit_length():
    scene = Scene()
    rim = detect_hole(scene.hole_image(), scene.sensor.camera, scene.expected())
    centre = np.array(rim.ellipse[:2])
    assert np.linalg.norm(rim.directions, axis=1) == pytest.approx(1.0)
    assert (((centre - rim.points) * rim.directions).sum(axis=1) > 0.0).all()


def test_a_burr_makes_the_edge_ambiguous():
    clean, burred = Scene(), Scene(burr=0.15)
    plain, ragged = (detect_hole(scene.hole_image(), scene.sensor.camera, scene.expected())
                     for scene in (clean, burred))
    assert ragged.ambiguity > plain.ambiguity + 0.5


def test_an_edge_softer_on_one_side_is_ambiguous():
    scene = Scene(noise=2.0, blur=0.6)
    image = scene.hole_image()
    lipped, left = cv2.GaussianBlur(image, (0, 0), 0.6), round(true_ellipse(scene).centre[0])
    lipped[:, :left] = image[:, :left]
    plain, uneven = (detect_hole(seen, scene.sensor.camera, scene.expected())
                     for seen in (image, lipped))
    assert uneven.ambiguity > plain.ambiguity + 0.3


def test_an_edge_is_ambiguous_where_it_is_softer_than_the_lens():
    soft, camera = Scene(noise=2.0, blur=1.4), Scene().sensor.camera
    image = soft.hole_image()
    nobody_knows, soft_lens, sharp_lens = (
        detect_hole(image, replace(camera, blur=blur), soft.expected()).ambiguity
        for blur in (None, 1.5, 0.9))
    assert soft_lens < 0.1 < 0.5 < min(nobody_knows, sharp_lens)


def test_no_rim_is_sharper_than_the_lens_leaves_an_edge():
    scene = Scene(noise=2.0, blur=0.7)
    image, camera = scene.hole_image(), scene.sensor.camera
    free, held = (detect_hole(image, replace(camera, blur=blur), scene.expected()).blur
                  for blur in (None, 1.6))
    assert free < 1.2 < 1.7 < held


@pytest.mark.parametrize("waves", [3, 4])
def test_waves_that_go_round_the_rim_are_form_and_no_noise(waves):
    plain, wavy = Scene(noise=2.0), Scene(noise=2.0, waves={waves: 0.02})
    even, uneven = (detect_hole(scene.hole_image(), scene.sensor.camera, scene.expected())
                    for scene in (plain, wavy))
    assert uneven.sigma < 1.3 * even.sigma
    assert uneven.correlation < 2.0 * even.correlation


@pytest.mark.parametrize("known", [True, False], ids=["nominals", "nothing known"])
def test_a_rim_that_borders_on_white_all_round_is_saturated(known):
    scene = Scene(plate=900.0, behind=20.0, wall=20.0)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor,
                    scene.expected() if known else Expected())
    assert refused.value.reason == "saturated"


def test_a_scratch_that_both_pictures_show_is_no_stripe():
    scene = Scene(stripe=0.0, ambient=20.0, noise=1.5)
    pictures = scene.hole_image(), scene.stripe_image()
    for picture in pictures:
        ground = float(np.median(picture))
        cv2.line(picture, (300, 20), (310, 300), 2.0 * ground, 3, cv2.LINE_AA)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(*pictures, scene.sensor, scene.expected())
    assert refused.value.reason == "no_laser"


@pytest.mark.parametrize(("y", "radius"), [(11.6, 4.0), (12.4, 4.0), (12.0, 5.0), (-13.5, 5.0)])
def test_a_hole_of_which_the_border_leaves_half_is_no_slot(y, radius):
    scene = Scene(centre=(1.0, y, 244.0), radius=radius)
    with pytest.raises(UnmeasurableError) as refused:
        detect_pair(scene.hole_image(), scene.stripe_image(), scene.sensor, Expected())
    assert refused.value.reason == "hole_cut_by_border"


def test_the_spread_of_the_edges_is_that_of_the_noise():
    quiet, loud = (detect_hole(scene.hole_image(), scene.sensor.camera, scene.expected())
                   for scene in (Scene(noise=2.0), Scene(noise=8.0)))
    assert 1.8 < loud.sigma / quiet.sigma < 5.0


def test_the_radius_is_not_biased_by_blur():
    for blur in (0.8, 2.0):
        scene = Scene(blur=blur, radius=2.0, noise=1.0, thickness=0.0)
        rim = detect_hole(scene.hole_image(), scene.sensor.camera, scene.expected())
        assert np.mean(rim.ellipse[2:4]) == pytest.approx(true_ellipse(scene).radius, abs=0.03)


def test_the_same_pictures_always_give_the_same_answer():
    scene = Scene(surface="spangled")
    hole, stripe, expected = scene.hole_image(), scene.stripe_image(), scene.expected()
    first, again = (detect_pair(hole, stripe, scene.sensor, expected) for _ in range(2))
    assert np.array_equal(first[0].points, again[0].points)
    assert np.array_equal(first[1].points, again[1].points)


def test_an_ellipse_moves_as_its_design_says():
    ellipse = Ellipse(np.array([3.0, 4.0]), np.array([[30.0, 2.0], [2.0, 25.0]]))
    t, step = np.linspace(0.0, 6.0, 9), np.array([0.01, -0.02, 0.03, 0.01, -0.02])
    shifts = ellipse.moved(step).points(t) - ellipse.points(t)
    outward = (shifts * ellipse.normals(t)).sum(axis=1)
    assert outward == pytest.approx(ellipse.design(t) @ step, abs=1e-9)


def test_edges_that_all_lie_off_alike_are_followed():
    start, rays = Ellipse.circle(40.0, 30.0, 20.0), np.arange(120)
    turn = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    band = Band(start, turn, np.arange(-3.0, 4.0), np.zeros((120, 7)))
    offset = 0.3 + 0.01 * np.random.default_rng(3).normal(size=120)
    ellipse, miss, _ = settle(band, Edges(rays, offset, offset), floor=0.01)
    assert abs(ellipse.radius - 20.3) < 0.005
    assert np.abs(miss).max() < 0.05


def test_a_projected_circle_is_the_camera_s_ellipse():
    camera = made_sensor().camera
    centre, normal = np.array([2.0, -1.0, 240.0]), np.array([0.2, -0.1, -0.97])
    ellipse = project_circle(camera, centre, normal / np.linalg.norm(normal), 5.0)
    scene = Scene(centre=tuple(centre), tilt=(np.degrees(np.arcsin(0.1 / 0.998)),
                                              np.degrees(np.arcsin(0.2 / 0.998))))
    assert ellipse.axes[:2] == pytest.approx(true_ellipse(scene).axes[:2], abs=0.3)
