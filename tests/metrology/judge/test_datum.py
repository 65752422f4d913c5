import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.metrology.judge.datum import Datum, UndeterminedError, solve_body_registration

BASE_FROM_BODY = Transform.from_parts([0.3, -0.5, 1.4], [1600.0, 1500.0, -250.0])
LOW, HIGH = np.array([0.0, -450.0, 200.0]), np.array([1400.0, 450.0, 600.0])  # of the facts' body


def datums(count, axes="xyz", noise=None, sigma=0.1, seed=1):
    nominal = np.random.default_rng(seed).uniform(LOW, HIGH, (count, 3))
    found = nominal if noise is None else nominal + noise
    return [Datum(str(i), n, BASE_FROM_BODY @ m, axes, (sigma,) * 3)
            for i, (n, m) in enumerate(zip(nominal, found, strict=True))]


@given(st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-5000, 5000)] * 3))
def test_exact_points_give_the_exact_registration(turn, shift):
    base_from_body = Transform.from_parts(turn, shift)
    points = [Datum(d.id, d.nominal, base_from_body @ d.nominal) for d in datums(5)]
    found = solve_body_registration(points).measured_from_body
    millimetres, radians = found.distance(base_from_body)
    assert millimetres < 1e-6
    assert radians < 1e-9


def three_two_one(noise):
    points = [("A", [100, -400, 250]), ("B", [1300, -420, 260]), ("C", [700, -380, 590])]
    axes = {"A": "xyz", "B": "yz", "C": "y"}
    return [Datum(name, np.array(p, float), BASE_FROM_BODY @ (np.array(p, float) + noise[name]),
                  axes[name]) for name, p in points]


def test_three_two_one_is_exact_along_its_axes_and_free_along_the_others():
    rng = np.random.default_rng(2)
    noise = {name: rng.normal(0, 0.3, 3) for name in "ABC"}
    guess = BASE_FROM_BODY.inverse
    found = solve_body_registration(three_two_one(noise), guess)
    assert found.redundancy == 0
    assert found.chi2 is None
    assert all(abs(gap) < 1e-9 for axes in found.residuals.values() for gap in axes.values())
    assert set(found.free["C"]) == {"x", "z"}
    assert abs(found.free["C"]["x"]) > 0.01
    assert found.left_out == {"A": None, "B": None, "C": None}


def test_an_axis_that_is_not_constrained_has_no_say():
    still = {name: np.zeros(3) for name in "ABC"}
    pushed = still | {"C": np.array([5.0, 0.0, -4.0])}
    guess = BASE_FROM_BODY.inverse
    one, other = (solve_body_registration(three_two_one(noise), guess) for noise in (still, pushed))
    millimetres, radians = one.body_from_measured.distance(other.body_from_measured)
    assert millimetres < 0.05  # of second order: the constraint point itself moved
    assert radians < 1e-4


def test_a_heavier_datum_pulls_more():
    noise = np.zeros((6, 3))
    noise[0, 1] = 1.0
    light = solve_body_registration(datums(6, noise=noise))
    trusted = datums(6, noise=noise)
    trusted[0] = Datum("0", trusted[0].nominal, trusted[0].measured, "xyz", (0.01,) * 3)
    heavy = solve_body_registration(trusted)
    assert abs(heavy.residuals["0"]["y"]) < 0.2 * abs(light.residuals["0"]["y"])


def test_a_datum_that_disagrees_is_missed_most_when_it_is_left_out():
    noise = np.random.default_rng(3).normal(0, 0.02, (7, 3))
    noise[4] = [0.9, -0.7, 0.4]
    found = solve_body_registration(datums(7, noise=noise))
    assert max(found.left_out, key=found.left_out.get) == "4"
    assert found.left_out["4"] > 0.8
    assert found.chi2 > 3.0


def test_predicted_uncertainty_is_what_repeated_registrations_scatter():
    rng = np.random.default_rng(4)
    holes = rng.uniform(LOW, HIGH, (6, 3))
    errors, motions = [], []
    for _ in range(400):
        noise = rng.normal(0, 0.1, (6, 3))
        found = solve_body_registration(datums(6, noise=BASE_FROM_BODY.inverse.turn(
            BASE_FROM_BODY.turn(noise))), leave_out=False)
        errors.append(found.body_from_measured @ (BASE_FROM_BODY @ holes) - holes)
        back = found.measured_from_body
        motions.append(np.concatenate([
            Rotation.from_matrix(back.rotation @ BASE_FROM_BODY.rotation.T).as_rotvec(),
            back.translation - BASE_FROM_BODY.translation]))
    np.testing.assert_allclose(np.std(errors, axis=0) / found.predict_sigma(holes), 1.0, atol=0.15)
    covariance = found.covariance_of_measured_from_body
    scatter = np.cov(np.transpose(motions))
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    np.testing.assert_allclose(whitener @ scatter @ whitener.T, np.eye(6), atol=0.3)


@pytest.mark.parametrize(("corners", "expected"), [
    ([0, 3, 5, 6], 0.107), ([0, 1, 3, 5, 6, 7], 0.085), ([*range(8)], 0.074)])
def test_datums_at_the_corners_register_as_well_as_the_study_found(corners, expected):
    """Simulated for a body of 1.4 x 0.9 x 0.4 m with 0.10 mm noise an axis: 3D rms at 60 holes."""
    rng = np.random.default_rng(5)
    holes = rng.uniform(LOW, HIGH, (60, 3))
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])[corners]
    points = [Datum(str(i), p, BASE_FROM_BODY @ p) for i, p in enumerate(LOW + box * (HIGH - LOW))]
    sigma = solve_body_registration(points, leave_out=False).predict_sigma(holes)
    assert np.sqrt(np.mean(np.sum(sigma**2, axis=1))) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize(("points", "words"), [
    ([(0, 0, 0), (100, 0, 0), (200, 0, 0), (350, 0, 0)], r"turn about \(-?1.00"),
    ([(0, 0, 0), (100, 50, 0)], "turn about"),
    ([(0, 0, 0)], "turn about"),
])
def test_datums_that_leave_a_motion_free_are_refused_by_it(points, words):
    line = [Datum(str(i), np.array(p, float), np.array(p, float)) for i, p in enumerate(points)]
    with pytest.raises(UndeterminedError, match=words):
        solve_body_registration(line, Transform.identity())


def test_a_plane_of_constraints_leaves_a_shift_free():
    flat = [Datum(str(i), np.array(p, float), np.array(p, float), "z")
            for i, p in enumerate([(0, 0, 0), (100, 0, 0), (0, 100, 0), (90, 80, 5)])]
    with pytest.raises(UndeterminedError, match="can still"):
        solve_body_registration(flat, Transform.identity())


def test_nothing_registers_nothing():
    with pytest.raises(UndeterminedError):
        solve_body_registration([])
    with pytest.raises(UndeterminedError):
        solve_body_registration([], Transform.identity())
