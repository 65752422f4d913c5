"""The image shows the truth: edges and stripes lie where exact geometry puts them."""

import numpy as np
import pytest
from made_scenes import camera_over, demo_world, plate
from scipy.ndimage import map_coordinates

from cell.core.geometry import Transform
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps

WORLD = demo_world()
LENS = Lens(WORLD.sensor)
STEPS = np.linspace(-6.0, 6.0, 241)


def picture(body, base_from_camera, *, ring=False, laser=False, exposure=0.008):
    lamps = Lamps(WORLD.sensor, ring, laser, 1)
    setting = Setting(Transform.identity(), body)
    return render(LENS, setting, base_from_camera, lamps, exposure).astype(float)


def rim_pixels(radius, centre, base_from_camera, count=360):
    """Project the true rim, and the direction in which it points outwards in the image."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    camera = WORLD.sensor.camera
    seen = [camera.project(base_from_camera.inverse @ (r * circle + [*centre, 0.0]))
            for r in (radius, radius + 0.01)]
    outward = seen[1] - seen[0]
    return seen[0], outward / np.linalg.norm(outward, axis=1, keepdims=True)


def edge_offsets(image, pixels, outward):
    """Find by how many px the image's edge lies outside of each true rim point.

    The profile across the edge, as a share of its two levels, holds as much area as an ideal step.
    """
    along = pixels[:, None, :] + STEPS[None, :, None] * outward[:, None, :]
    profile = map_coordinates(image, [along[..., 1], along[..., 0]], order=3)
    inside, outside = profile[:, :15].mean(axis=1), profile[:, -15:].mean(axis=1)
    share = (profile - inside[:, None]) / (outside - inside)[:, None]
    return STEPS[-1] - np.trapezoid(share, STEPS, axis=1)


@pytest.mark.parametrize(("radius", "tilt", "roll"), [
    (2.5, (1.5, -2.0), 20.0), (5.0, (4.0, 3.0), 70.0), (8.0, (-6.0, 1.0), -35.0),
    (12.0, (2.0, 8.0), 130.0)])
def test_rim_lies_where_it_is_seen(radius, tilt, roll):
    """Looked at from the side where the bore's wall is hidden, all round in the mean."""
    centre = (3.1, -2.4)
    pose = camera_over(1.7, -3.3, tilt_deg=tilt, roll_deg=roll)
    image = picture(plate(radius, thickness=0.01, centre=centre), pose, ring=True)
    pixels, outward = rim_pixels(radius, centre, pose)
    offsets = edge_offsets(image, pixels, outward)
    shift = np.linalg.lstsq(outward, offsets, rcond=None)[0]
    blur_pulls_in = -0.85**2 / (2 * radius / 242 * 3480)
    assert np.abs(shift).max() < 0.01
    assert abs(np.median(offsets) - blur_pulls_in) < 0.02
    assert np.sqrt(np.mean((offsets - np.median(offsets)) ** 2)) < 0.03


def test_rim_shows_the_form_of_the_hole():
    form = np.zeros((2, 5))
    form[0, 1] = 0.1  # three lobes of 0.1 mm
    pose = camera_over(0.5, 0.8, tilt_deg=(1.0, 1.0))
    image = picture(plate(6.0, thickness=0.01, form=form), pose, ring=True)
    pixels, outward = rim_pixels(6.0, (0.0, 0.0), pose)
    offsets = edge_offsets(image, pixels, outward)
    angles = np.linspace(0.0, 2.0 * np.pi, len(offsets), endpoint=False)
    lobes = 2.0 * np.mean(offsets * np.cos(3 * angles)) * 242.4 / 3480
    assert lobes == pytest.approx(0.1, abs=0.003)


def test_wall_shows_where_the_sheet_is_thick():
    """Tilted, the inner rim of the far side is seen through the bore by thickness times tangent."""
    pose = camera_over(0.0, 0.0, tilt_deg=(0.0, 9.0))
    radius, thickness = 5.0, 2.0
    thick = picture(plate(radius, thickness=thickness), pose, ring=True)
    thin = picture(plate(radius, thickness=0.001), pose, ring=True)
    lighter = (thick - thin).sum() / (thick - thin).max()
    seen_mm2 = 2.0 * radius * thickness * np.tan(np.radians(9.0))
    assert lighter * (242.4 / 3480) ** 2 == pytest.approx(seen_mm2, rel=0.6)
    assert (thick - thin).min() > -3.0


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (3.0, -4.0), (-5.0, 6.0)])
def test_stripe_lies_in_the_light_plane(tilt):
    """The brightness' centre in each row, carried to the plate, lies in the light plane."""
    pose = camera_over(1.0, -2.0, distance=240.0, tilt_deg=tilt)
    body = plate(2.5, centre=(60.0, 60.0))
    quiet = WORLD.sensor.design.model_copy(update={"speckle": 0.0, "ambient_level": 0.0})
    sensor = type(WORLD.sensor)(WORLD.sensor.camera, WORLD.sensor.light_plane, quiet)
    image = render(Lens(sensor), Setting(Transform.identity(), body), pose,
                   Lamps(sensor, False, True, 1), 0.002).astype(float) - 4.0
    image[image < 1.5] = 0.0
    rows = np.arange(40, 536)
    columns = (image @ np.arange(768.0) / image.sum(axis=1))[rows]
    rays = WORLD.sensor.camera.rays(np.column_stack([columns, rows]))
    outward, inverse = pose.inverse.turn([0.0, 0.0, 1.0]), pose.inverse
    points = rays * ((outward @ inverse.translation) / (rays @ outward))[:, None]
    distance = WORLD.sensor.light_plane.distance(points)
    assert abs(distance.mean()) < 0.0012  # 0.02 px
    assert distance.std() < 0.01
