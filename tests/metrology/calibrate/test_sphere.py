"""A sphere of known radius, by sections through it: synthetic ones, and as the camera sees them."""

import numpy as np
import pytest
from made_boards import LENS, SCENE, SETTING, TRUTH
from scipy.spatial.transform import Rotation

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Plane
from cell.core.optics import SensorModel
from cell.metrology.calibrate.detect_sphere_stripe import detect_sphere_stripe
from cell.metrology.calibrate.sphere import SphereProblem, solve_sphere
from cell.metrology.calibrate.sphere_views import draw_sphere_views
from cell.sim.render import render
from cell.sim.render_light import Lamps

CENTRE, RADIUS = np.array([561.3, -558.9, 11.7]), 10.0
ROUGH = CENTRE + np.array([4.0, -3.0, -2.5])
TURNS = [(10, 3, -8), (80, 22, 5), (-130, -19, 12), (150, 6, 24), (-60, -25, -9), (30, 17, -21)]


def section(turn, rng, noise=0.01, off=2.0, radius=RADIUS):
    """The lit half of a circle that a plane cuts out of the sphere, `off` from its centre."""
    lean = Rotation.from_euler("zxy", turn, degrees=True)
    along, up, across = lean.apply(np.eye(3)[[0, 2, 1]])
    angle = np.radians(np.linspace(-62.0, 55.0, 200))[:, None]
    points = CENTRE + off * across + np.sqrt(radius**2 - off**2) * (
        np.sin(angle) * along + np.cos(angle) * up)
    return points + rng.normal(0.0, noise, points.shape)


def sections(noise=0.01, **changes):
    rng = np.random.default_rng(3)
    return tuple(section(turn, rng, noise, 1.0 + index % 3, **changes)
                 for index, turn in enumerate(TURNS))


def test_the_centre_is_found_from_a_rough_one():
    result = solve_sphere(SphereProblem(sections(), RADIUS, ROUGH))
    assert result.centre == pytest.approx(CENTRE, abs=0.005)
    assert result.radius == pytest.approx(RADIUS, abs=0.005)
    assert result.spread < 0.01


def test_stray_points_do_not_pull():
    spoilt = [some.copy() for some in sections()]
    for some in spoilt:
        some[:20] += [0.0, 1.5, 2.5]
    result = solve_sphere(SphereProblem(tuple(spoilt), RADIUS, ROUGH))
    assert result.centre == pytest.approx(CENTRE, abs=0.01)


def test_a_pose_that_stands_elsewhere_is_seen_in_the_spread():
    apart = list(sections())
    apart[2] = apart[2] + [0.3, -0.2, 0.25]
    result = solve_sphere(SphereProblem(tuple(apart), RADIUS, ROUGH))
    sizes = np.linalg.norm(result.shifts, axis=1)
    assert int(np.argmax(sizes)) == 2 and sizes[2] > 0.2
    assert result.spread > 0.08


def test_a_wrong_radius_is_told():
    result = solve_sphere(SphereProblem(sections(radius=10.2), RADIUS, ROUGH))
    assert result.radius == pytest.approx(10.2, abs=0.01)


def test_the_covariance_covers_poses_that_scatter():
    rng, misses = np.random.default_rng(8), []
    for _ in range(40):
        shaken = tuple(some + rng.normal(0.0, 0.05, 3) for some in sections())
        result = solve_sphere(SphereProblem(shaken, RADIUS, ROUGH))
        off = result.centre - CENTRE
        misses.append(off @ np.linalg.solve(result.covariance, off) / 3.0)
    assert 0.3 < np.median(misses) < 2.0


@pytest.mark.parametrize(("some", "code"), [
    (lambda: sections()[:2], "too_few_poses"),
    (lambda: tuple(np.random.default_rng(1).normal(0.0, 400.0, (50, 3)) for _ in range(4)),
     "no_sphere")])
def test_what_is_no_sphere_is_refused(some, code):
    with pytest.raises(UnmeasurableError) as caught:
        solve_sphere(SphereProblem(some(), RADIUS, ROUGH))
    assert caught.value.reason == code


def looks(sensor, chance):
    """See the demo cell's sphere from eight poses, and carry its stripe to the base."""
    rough = np.array(SCENE.spheres[0].centre) + np.array([2.0, -2.0, 3.0])
    for index, base_from_camera in enumerate(draw_sphere_views(8, sensor, rough, RADIUS)):
        lamps = Lamps(TRUTH, ring=False, laser=True, grain=index)
        image = render(LENS, SETTING, base_from_camera, lamps, 0.004, chance)
        pixels = detect_sphere_stripe(image, sensor, base_from_camera.inverse @ rough, RADIUS)
        yield base_from_camera @ sensor.light_plane.meet(sensor.camera.rays(pixels))


def solve_looks(sensor):
    centre = np.array(SCENE.spheres[0].centre)
    seen = tuple(looks(sensor, np.random.default_rng(5)))
    return solve_sphere(SphereProblem(seen, RADIUS, centre + 3.0)), centre


def test_the_sphere_in_pictures_is_where_it_truly_is():
    result, centre = solve_looks(SensorModel(TRUTH.camera, TRUTH.light_plane))
    assert result.centre == pytest.approx(centre, abs=0.02)
    assert result.radius == pytest.approx(RADIUS, abs=0.03)
    assert result.spread < 0.02 and result.rms < 0.03


def test_a_light_plane_that_has_moved_shows_in_the_spread():
    plane = TRUTH.light_plane
    result, _ = solve_looks(SensorModel(TRUTH.camera, Plane(plane.normal, plane.offset - 0.25)))
    assert result.spread > 0.15


def test_no_stripe_is_said_so():
    sensor, dark = SensorModel(TRUTH.camera, TRUTH.light_plane), np.zeros((576, 768), np.uint8)
    for centre in ([0.0, 0.0, 245.0], [200.0, 0.0, 245.0]):
        with pytest.raises(UnmeasurableError, match="no_stripe"):
            detect_sphere_stripe(dark, sensor, np.array(centre), RADIUS)
