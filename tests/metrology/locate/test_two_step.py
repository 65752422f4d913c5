"""The two-step method: the paper's equations on exact points, and an uncertainty that is true."""

import numpy as np
import pytest
from made_points import (
    SENSOR_A,
    SENSOR_B,
    Noise,
    TrueHole,
    make_pair,
    make_rim,
    make_stripe,
    plan_of,
    tilted,
)

from cell.core.errors import UnmeasurableError
from cell.metrology.features import Expected
from cell.metrology.locate.error_model import two_step_error
from cell.metrology.locate.two_step import locate_two_step

EXACT = Noise()


def located(hole, sensor, expected=None, noise=EXACT, seed=0):
    rim, stripe = make_pair(hole, sensor, noise, np.random.default_rng(seed))
    return locate_two_step(rim, stripe, sensor, expected or Expected())


@pytest.mark.parametrize("sensor", [SENSOR_A, SENSOR_B])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.7, -3.1, 2.2), (-2.4, 4.6, -3.3)])
def test_a_hole_seen_square_is_located_exactly(sensor, place):
    centre = np.array([0, 0, sensor.working_distance]) + place
    hole = TrueHole(centre, tilted(0, 0), 6.3)
    found = located(hole, sensor)
    assert found.centre == pytest.approx(hole.centre, abs=1e-6)
    assert found.radius == pytest.approx(6.3, abs=1e-6)
    assert found.normal is None


@pytest.mark.parametrize(("b", "g"), [(2.0, 0.0), (0.0, -3.0), (-6.0, 4.0), (9.0, 7.0)])
def test_a_tilted_hole_is_off_by_what_the_error_model_says(b, g):
    hole = TrueHole(np.array([1.5, -2.0, 254.0]), tilted(b, g), 7.0)
    found = located(hole, SENSOR_B)
    error = two_step_error(SENSOR_B.light_plane, hole.centre, hole.normal, hole.radius)
    assert np.linalg.norm(error[:3]) > 0.002
    assert found.centre - hole.centre == pytest.approx(error[:3], abs=1e-5)


def test_the_uncertainty_covers_the_methods_own_error():
    rng = np.random.default_rng(8)
    ratios = []
    for seed in range(40):
        centre = np.array([0, 0, 253.0]) + rng.uniform(-2, 2, 3)
        hole = TrueHole(centre, tilted(*rng.normal(0, 2, 2)), 6.0)
        plan = plan_of(hole, np.radians(0.5), rng)
        found = located(hole, SENSOR_B, plan, Noise(0.05, 0.1, 0.003, 0.05), seed)
        ratios.append((found.centre - hole.centre) / np.sqrt(np.diag(found.covariance)[:3]))
    assert (np.abs(ratios) < 3.0).mean() > 0.98
    assert (np.median(np.abs(ratios), axis=0) > 0.2).all()


def test_the_budget_adds_up():
    hole = TrueHole(np.array([1.5, -2.0, 254.0]), tilted(1, 2), 7.0)
    found = located(hole, SENSOR_B, noise=Noise(0.1, 0.2, 0.003, 0.05))
    assert sum(found.sources.values()) == pytest.approx(found.covariance)
    squares = np.sum(np.square(list(found.budget.values())), axis=0)
    assert squares == pytest.approx(np.diag(found.covariance))
    assert found.budget["method"][2] > 0.05  # an unknown tilt is what hurts


def test_a_stripe_beside_the_hole_is_refused():
    rng = np.random.default_rng(0)
    aside = TrueHole(np.array([6.0, 0.0, 253.0]), tilted(0, 0), 4.0)
    under = TrueHole(np.array([0.0, 0.0, 253.0]), tilted(0, 0), 4.0)
    with pytest.raises(UnmeasurableError) as refused:
        locate_two_step(make_rim(aside, EXACT, rng), make_stripe(under, SENSOR_B, EXACT, rng),
                        SENSOR_B, Expected())
    assert refused.value.reason == "laser_misses_hole"
