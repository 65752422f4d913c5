"""Light behaves as light does: lamps, materials, depth behind the hole, noise."""

import numpy as np
import pytest
from made_scenes import camera_over, demo_world, plate

from cell.core.geometry import Transform
from cell.sim.materials import FINISHES, TILE, pattern
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps
from cell.sim.scene import Behind
from cell.sim.world import TrueSensor

WORLD = demo_world()
LENS = Lens(WORLD.sensor)
POSE = camera_over(0.0, 0.0, tilt_deg=(1.0, -2.0))
MIDDLE = np.s_[300:325, 298:323]


def picture(body, *, ring=False, laser=False, exposure=0.004, pose=POSE, seed=None, grain=1):
    chance = None if seed is None else np.random.default_rng(seed)
    return render(LENS, Setting(Transform.identity(), body), pose,
                  Lamps(WORLD.sensor, ring, laser, grain), exposure, chance).astype(float)


@pytest.mark.parametrize("finish", sorted(FINISHES))
def test_every_finish_is_well_exposed_by_the_demo(finish):
    """Neither lost in the dark nor saturated, with the exposures of the demo cell."""
    ring = picture(plate(6.0, finish=finish), ring=True, exposure=0.008, seed=1)
    face = ring[:150]
    assert 25 < np.median(face) < 210
    assert (face == 255).mean() < 0.03
    assert np.median(ring[MIDDLE]) < 0.5 * np.median(face)


def test_patterns_repeat_without_a_seam():
    for finish in ("steel", "galvanised", "primer"):
        tile = pattern(finish)
        assert tile.shape == (TILE, TILE)
        seam = np.abs(tile[:, 0] - tile[:, -1]).mean()
        inside = np.abs(np.diff(tile, axis=1)).mean()
        assert seam < 2.0 * inside
        assert tile.mean() == pytest.approx(1.0, abs=0.02)


def test_lamps_add_up():
    body = plate(5.0, finish="primer")
    dark = picture(body)
    ring, laser = picture(body, ring=True) - dark, picture(body, laser=True) - dark
    both = picture(body, ring=True, laser=True) - dark
    free = both + dark < 250
    assert np.abs(both - ring - laser)[free].max() <= 2.0


def test_a_second_sheet_shows_its_own_piece_of_stripe_where_light_gets_through():
    gap = 12.0
    body = plate(10.0, behind=Behind(gap_mm=gap, finish="ceramic"), thickness=1.0)
    pose = camera_over(0.0, 0.0)
    image = picture(body, laser=True, pose=pose)
    row = int(WORLD.sensor.camera.project(pose.inverse @ np.zeros(3))[1])
    bright = np.flatnonzero(image[row] > 60)
    assert len(bright) > 3
    ray = WORLD.sensor.camera.rays([bright.mean(), row])
    depth = WORLD.sensor.light_plane.meet(ray)[2]
    assert depth == pytest.approx(242.4 + 1.0 + gap, abs=0.1)


def test_no_laser_falls_through_a_hole_where_the_rim_is_in_the_way():
    """The laser comes in at 29 degrees: 40 mm behind a hole of 5 mm it cannot arrive."""
    body = plate(5.0, behind=Behind(gap_mm=40.0, finish="ceramic"))
    image = picture(body, laser=True, pose=camera_over(0.0, 0.0))
    rows = slice(300, 325)
    assert image[rows].max() < 20


def test_the_ring_lights_a_near_second_sheet_and_not_one_far_behind_a_small_hole():
    near, far = (picture(plate(4.0, behind=Behind(gap_mm=gap, finish="ceramic")), ring=True,
                         pose=camera_over(0.0, 0.0))[MIDDLE].mean() for gap in (5.0, 120.0))
    assert near > 3.0 * far


def test_noise_grows_with_light_as_counted_electrons_do():
    design = WORLD.sensor.design
    body = plate(2.5, finish="ceramic")
    for exposure in (0.002, 0.008):
        clean = picture(body, ring=True, exposure=exposure)
        noisy = np.stack([picture(body, ring=True, exposure=exposure, seed=seed)
                          for seed in range(12)])
        expected = np.sqrt(np.median(clean) / design.electrons_per_grey + design.read_noise**2
                           + 1 / 12)
        assert np.median(noisy.std(axis=0, ddof=1)) == pytest.approx(expected, rel=0.08)


def test_speckle_shakes_the_stripe_about_its_place_but_does_not_move_it():
    body = plate(2.5, finish="steel", centre=(80.0, 80.0))
    quiet = TrueSensor(WORLD.sensor.camera, WORLD.sensor.light_plane,
                       WORLD.sensor.design.model_copy(update={"speckle": 0.0}))
    rows = np.s_[50:500]

    def centres(sensor, grain):
        image = render(Lens(sensor), Setting(Transform.identity(), body), POSE,
                       Lamps(sensor, False, True, grain), 0.002).astype(float)[rows]
        image[image < 12] = 0.0
        return image @ np.arange(768.0) / image.sum(axis=1)

    still = centres(quiet, 1)
    shaken = np.array([centres(WORLD.sensor, grain) - still for grain in range(6)])
    assert 0.05 < shaken.std() < 0.5
    assert abs(shaken.mean()) < 0.02
    assert np.abs(np.corrcoef(shaken)[~np.eye(6, dtype=bool)]).max() < 0.3


def test_off_its_distance_the_lens_blurs():
    near, sharp = (picture(plate(5.0), ring=True, pose=camera_over(0.0, 0.0, distance=distance))
                   for distance in (200.0, 242.4))
    steepest = [np.abs(np.diff(image, axis=1)).max() / np.median(image) for image in (near, sharp)]
    assert steepest[0] < 0.7 * steepest[1]
