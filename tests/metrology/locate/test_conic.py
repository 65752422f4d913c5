"""Conics and lines: exact on exact data, in any direction, and refused where there is nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_points import CAMERA, Noise, TrueHole, conic_of_circle, rim_points, tilted

from cell.core.errors import UnmeasurableError
from cell.metrology.locate import conic

NO_NOISE = Noise()
angles = st.floats(-40, 40)
small = st.floats(-15, 15)
offsets = st.floats(-20, 20)


@settings(max_examples=40, deadline=None)
@given(angles, angles, offsets, offsets, st.floats(1, 15))
def test_a_circle_projects_to_the_conic_through_its_points(b, g, x, y, radius):
    hole = TrueHole(np.array([x, y, 250.0]), tilted(b, g), radius)
    rays = CAMERA.rays(rim_points(hole, NO_NOISE, np.random.default_rng(0))[0])
    projected = conic_of_circle(hole.centre, hole.normal, radius)
    fitted = conic.fit_conic(rays[:, :2])
    beyond = np.einsum("ni,ij,nj->n", rays, projected, rays) / (rays @ hole.normal) ** 2
    assert np.abs(beyond).max() < 1e-8  # |X - C|² - r² in mm²
    assert np.allclose(fitted / np.linalg.norm(fitted), projected / np.linalg.norm(projected),
                       atol=1e-6)


@settings(max_examples=40, deadline=None)
@given(small, small, offsets, offsets, st.floats(2, 15))
def test_the_true_centre_is_the_pole_and_not_the_ellipses_centre(b, g, x, y, radius):
    hole = TrueHole(np.array([x, y, 250.0]), tilted(b, g), radius)
    matrix = conic_of_circle(hole.centre, hole.normal, radius)
    ray = conic.circle_centre_ray(matrix, hole.normal)
    assert np.allclose(ray * 250.0, hole.centre, atol=1e-9)
    off = np.linalg.norm(conic.ellipse_centre(matrix) * 250.0 - hole.centre[:2])
    tilt = np.arccos(min(1.0, -hole.normal[2]))
    assert off == pytest.approx(radius**2 * np.sin(tilt) * np.cos(tilt) / 250.0, abs=1e-4, rel=0.1)


@pytest.mark.parametrize("turn_deg", [0.0, 37.0, 89.0, 90.0, 135.0, 180.0, 271.0])
def test_a_chord_is_cut_by_a_line_in_any_direction(turn_deg):
    n = np.array([np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))])
    circle = conic_of_circle([1.0, 2.0, 100.0], [0.0, 0.0, -1.0], 5.0)
    line = np.append(n, -n @ [0.01, 0.02] - 0.03)
    ends = np.array(conic.chord(circle, line))
    assert np.abs(ends @ line[:2] + line[2]).max() < 1e-12
    assert np.allclose(np.linalg.norm(ends - [0.01, 0.02], axis=1), 0.05)


def test_a_line_beside_the_ellipse_is_refused():
    circle = conic_of_circle([1.0, 2.0, 100.0], [0.0, 0.0, -1.0], 5.0)
    with pytest.raises(UnmeasurableError) as refused:
        conic.chord(circle, np.array([1.0, 0.0, -0.061]))
    assert refused.value.reason == "laser_misses_hole"


@settings(max_examples=40, deadline=None)
@given(st.floats(0, np.pi), st.floats(-3, 3))
def test_a_line_is_found_in_any_direction_and_outliers_do_not_turn_it(turn, c):
    n = np.array([np.cos(turn), np.sin(turn)])
    points = -c * n + np.outer(np.linspace(-1, 1, 80), [-n[1], n[0]])
    points[::10] += 0.5 * n
    line = conic.fit_line(points)
    assert abs(line[:2] @ n) == pytest.approx(1.0, abs=1e-4)
    assert abs(line[2]) == pytest.approx(abs(c), abs=0.03)


def test_noise_does_not_shrink_the_conic():
    rng = np.random.default_rng(4)
    hole = TrueHole(np.array([2.0, -1.0, 250.0]), tilted(8, -5), 5.0)
    truth = conic_of_circle(hole.centre, hole.normal, hole.radius)
    centres = [conic.ellipse_centre(conic.fit_conic(CAMERA.normalise(
        rim_points(hole, Noise(edge=0.3), rng)[0]))) for _ in range(60)]
    bias = np.abs(np.mean(centres, axis=0) - conic.ellipse_centre(truth)) * CAMERA.matrix[0, 0]
    assert bias.max() < 0.01


@pytest.mark.parametrize("points", [np.zeros((4, 2)), np.array([[t, t**3] for t in range(9)])])
def test_points_that_make_no_ellipse_are_refused(points):
    with pytest.raises(UnmeasurableError):
        conic.fit_conic(points)
