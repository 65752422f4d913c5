"""The paper's error equations against exact geometry: what is right, and what is misprinted."""

import numpy as np
import pytest
from made_points import ALPHA, SENSOR_A, SENSOR_B, L, conic_of_circle

from cell.metrology.locate.conic import ellipse_centre
from cell.metrology.locate.error_model import (
    Ranges,
    SensorGeometry,
    chord_midpoint_error,
    error_x,
    error_y,
    error_z,
    general_extremes,
    paper_extremes,
    two_step_error,
)
from cell.metrology.locate.two_step import solve_two_step

POSES = 20_000
GEOMETRY = SensorGeometry(L, ALPHA)


@pytest.fixture(scope="module")
def poses():
    """Random poses within +-10 degrees and +-5 mm: x_d, y_d, z_d, beta."""
    rng = np.random.default_rng(7)
    x_d, y_d, z_d = rng.uniform(-5, 5, (3, POSES))
    return x_d, y_d, z_d, np.radians(rng.uniform(-10, 10, POSES))


@pytest.fixture(scope="module")
def measured(poses):
    """What the method gives with the centre's true image: z of the chord's midpoint, the ray."""
    x_d, y_d, z_d, beta = poses
    # The plane through the centre along (cos b, sin b) meets the light plane in this x, z.
    step = -(x_d + z_d * np.tan(ALPHA)) / (np.cos(beta) + np.tan(ALPHA) * np.sin(beta))
    z_m = L + z_d + step * np.sin(beta)
    return x_d * z_m / (L + z_d), y_d * z_m / (L + z_d), z_m


def test_equations_15_17_and_20_are_exact_for_a_tilt_about_y(poses, measured):
    x_d, y_d, z_d, beta = poses
    x_m, y_m, z_m = measured
    assert np.abs(error_z(GEOMETRY, x_d, z_d, beta) - (z_m - L - z_d)).max() < 1e-12
    assert np.abs(error_x(GEOMETRY, x_d, z_d, beta) - (x_m - x_d)).max() < 1e-12
    assert np.abs(error_y(GEOMETRY, (x_d, y_d, z_d), beta) - (y_m - y_d)).max() < 1e-12


def test_equation_19_as_printed_has_the_wrong_sign(poses, measured):
    x_d, y_d, z_d, beta = poses
    printed = y_d * (x_d + z_d * np.tan(ALPHA)) / (
        (L + z_d) * (1 + np.tan(ALPHA) * np.tan(beta))) * np.tan(beta)
    true_error = measured[1] - y_d
    assert np.abs(printed + true_error).max() < 1e-12
    assert np.abs(printed - true_error).max() > 0.04


def test_the_printed_plane_gives_other_constants_than_the_text():
    geometry = SensorGeometry.from_light_plane(SENSOR_A.light_plane)
    assert pytest.approx(242.43, abs=0.005) == geometry.L
    assert np.degrees(geometry.alpha) == pytest.approx(29.03, abs=0.005)
    assert SENSOR_A.working_distance == geometry.L
    assert SENSOR_A.triangulation_angle == geometry.alpha


@pytest.mark.parametrize("sensor", [SENSOR_A, SENSOR_B])
def test_the_general_formula_is_exact_for_a_tilt_about_both_axes(sensor):
    rng = np.random.default_rng(3)
    plane = sensor.light_plane
    centre = np.array([0, 0, sensor.working_distance]) + rng.uniform(-5, 5, (POSES, 3))
    normal = np.column_stack([np.tan(np.radians(rng.uniform(-10, 10, (POSES, 2)))),
                              -np.ones(POSES)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    along = np.cross(normal, plane.normal)
    along /= np.linalg.norm(along, axis=1)[:, None]
    # A point on the line of both planes, by solving for it; the foot of the centre on that line.
    rows = np.stack([np.broadcast_to(plane.normal, normal.shape), normal, along], axis=1)
    right = np.stack([np.full(POSES, -plane.offset), np.sum(normal * centre, axis=1),
                      np.zeros(POSES)], axis=1)
    point = np.linalg.solve(rows, right[..., None])[..., 0]
    foot = point + np.sum((centre - point) * along, axis=1)[:, None] * along
    assert np.abs(chord_midpoint_error(plane, centre, normal) - (foot - centre)).max() < 1e-11


@pytest.mark.parametrize("sensor", [SENSOR_A, SENSOR_B])
def test_the_predicted_error_is_that_of_the_solved_equations(sensor):
    """Eccentricity included; the radius to second order."""
    rng = np.random.default_rng(5)
    plane, compared = sensor.light_plane, 0
    for _ in range(300):
        centre = np.array([0, 0, sensor.working_distance]) + rng.uniform(-5, 5, 3)
        normal = np.append(np.tan(np.radians(rng.uniform(-10, 10, 2))), -1.0)
        normal /= np.linalg.norm(normal)
        radius = rng.uniform(2, 15)
        if np.linalg.norm(chord_midpoint_error(plane, centre, normal)) > 0.8 * radius:
            continue
        conic = conic_of_circle(centre, normal, radius)
        line = plane.offset * normal + (normal @ centre) * plane.normal
        solved = solve_two_step(conic, line / np.linalg.norm(line[:2]), plane)
        error = two_step_error(plane, centre, normal, radius)
        assert np.abs(error[:3] - (solved.centre - centre)).max() < 1e-9
        assert error[3] == pytest.approx(solved.radius - radius, abs=2e-3, rel=0.15)
        compared += 1
    assert compared > 100


def test_the_largest_errors_of_the_papers_box():
    x, y, z = paper_extremes(GEOMETRY, Ranges())
    assert z == pytest.approx(0.244, abs=5e-4)
    assert (x, y) == (pytest.approx(0.0049, abs=5e-5), pytest.approx(0.0049, abs=5e-5))
    printed = SensorGeometry.from_light_plane(SENSOR_A.light_plane)
    assert paper_extremes(printed, Ranges())[2] == pytest.approx(0.277, abs=5e-4)


@pytest.mark.parametrize(("radius", "expected"), [
    (3.0, (0.0025, 0.0020, 0.084)), (5.0, (0.0062, 0.0044, 0.142)), (10.0, (0.0190, 0.0141, 0.244)),
    (15.0, (0.0365, 0.0317, 0.244))])
def test_the_largest_errors_in_any_direction(radius, expected):
    found = general_extremes(SENSOR_B.light_plane, Ranges(), radius)
    assert found[:3] == pytest.approx(expected, rel=0.08)


def test_eccentricity_is_where_the_ellipses_centre_is():
    centre, normal = np.array([3.0, -2.0, 250.0]), np.array([0.1, -0.05, -1.0])
    on_light = SENSOR_B.light_plane.normal * SENSOR_B.light_plane.distance(centre)
    centre = centre - on_light  # on the light plane only eccentricity is left
    conic = conic_of_circle(centre, normal, 9.0)
    beside = np.append(ellipse_centre(conic), 1.0) * centre[2] - centre
    assert np.allclose(two_step_error(SENSOR_B.light_plane, centre, normal, 9.0)[:3], beside)
