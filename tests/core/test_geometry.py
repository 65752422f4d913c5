"""Transforms and planes by their properties, near the identity and half a turn included."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cell.core.geometry import Plane, Transform

coordinates = st.floats(-2000.0, 2000.0, allow_subnormal=False)
vectors = arrays(np.float64, 3, elements=coordinates)
axes = arrays(np.float64, 3, elements=st.floats(-1.0, 1.0, allow_subnormal=False)).filter(
    lambda v: np.linalg.norm(v) > 1e-3)
angles = st.one_of(st.floats(-np.pi, np.pi), st.sampled_from([0.0, 1e-12, 1e-7, np.pi - 1e-9]))


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    axis = draw(axes)
    return Transform.from_parts(axis / np.linalg.norm(axis) * draw(angles), draw(vectors))


@given(transforms(), vectors)
def test_the_inverse_brings_a_point_back(a_from_b: Transform, point_in_b: np.ndarray) -> None:
    assert a_from_b.inverse @ (a_from_b @ point_in_b) == pytest.approx(point_in_b, abs=1e-9)


@given(transforms(), transforms(), vectors)
def test_composing_is_carrying_twice(a_from_b: Transform, b_from_c: Transform,
                                     point_in_c: np.ndarray) -> None:
    once = (a_from_b @ b_from_c) @ point_in_c
    assert once == pytest.approx(a_from_b @ (b_from_c @ point_in_c), abs=1e-8)


@given(transforms(), arrays(np.float64, (4, 5, 3), elements=coordinates))
def test_many_points_are_carried_as_one_would_be(a_from_b: Transform, points: np.ndarray) -> None:
    assert (a_from_b @ points)[2, 3] == pytest.approx(a_from_b @ points[2, 3], abs=1e-9)


@given(axes, st.floats(0.0, np.pi - 1e-6), vectors)
def test_distance_is_the_angle_turned_and_the_way_gone(axis: np.ndarray, angle: float,
                                                       shift: np.ndarray) -> None:
    turned = Transform.from_parts(axis / np.linalg.norm(axis) * angle, shift)
    millimetres, radians = Transform.identity().distance(turned)
    assert millimetres == pytest.approx(np.linalg.norm(shift))
    assert radians == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize(("spoil", "words"), [
    (lambda m: m * 1.001, "0 0 0 1"),
    (lambda m: np.diag([1.0, 1.0, -1.0, 1.0]) @ m, "mirror"),
    (lambda m: m + np.pad([[1e-3]], ((0, 3), (1, 2))), "rotation"),
    (lambda m: m * np.nan, "finite"),
    (lambda m: m[:3], "4x4"),
])
def test_what_is_no_rigid_motion_is_refused(spoil, words: str) -> None:
    matrix = Transform.from_parts([0.3, -0.2, 0.9], [10.0, 20.0, 30.0]).matrix
    with pytest.raises(ValueError, match=words):
        Transform(spoil(matrix.copy()))


def test_the_matrix_is_kept_to_the_bit_and_cannot_be_changed() -> None:
    given_matrix = Transform.from_parts([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]).matrix
    kept = Transform(given_matrix)
    assert kept.matrix.tobytes() == given_matrix.tobytes()
    with pytest.raises(ValueError, match="read-only"):
        kept.matrix[0, 3] = 5.0


@given(axes, vectors, arrays(np.float64, (7, 3), elements=st.floats(-0.5, 0.5)))
def test_rays_meet_the_plane_on_the_plane(normal: np.ndarray, point: np.ndarray,
                                          rays: np.ndarray) -> None:
    plane = Plane.through(point, normal)
    directions = np.add(rays, [0.0, 0.0, 1.0])
    slanted = np.abs(directions @ plane.normal) > 1e-2
    met = plane.meet(directions[slanted])
    assert plane.distance(met) == pytest.approx(0.0, abs=1e-6)
    assert np.cross(met, directions[slanted]) == pytest.approx(0.0, abs=1e-6)


def test_a_plane_need_not_come_normalised() -> None:
    plane = Plane.from_coefficients([2.0, 0.0, 0.0, -10.0])
    assert plane.distance([8.0, 1.0, 1.0]) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="not all zero"):
        Plane.from_coefficients([0.0, 0.0, 0.0, 1.0])
