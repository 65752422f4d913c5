"""Where the body lies, from the holes measured so far."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cell.core.documents.nominals import Hole
from cell.core.documents.result import Located, Measured
from cell.core.geometry import Transform
from cell.metrology.plan.body_prediction import predict_body

RNG = np.random.default_rng(3)
PLACES = np.array([1450.0, -700.0, 620.0]) + RNG.uniform(-1, 1, (12, 3)) * [250.0, 60.0, 280.0]
LOCATED = Located("joint", np.zeros(3), 5.0, None, np.eye(4))


def hole(number):
    return Hole(f"H{number}", PLACES[number], np.array([0.0, -1.0, 0.0]), 10.0, 1.0, "camera",
                frozenset("xyzd"), {})


HOLES = tuple(hole(number) for number in range(len(PLACES)))


def measured(number, centre, u=0.05):
    return Measured(f"H{number}", centre, 10.0, np.eye(4) * u**2, None, LOCATED, LOCATED, 0)


def displaced(turn_deg, shift):
    middle = PLACES.mean(axis=0)
    turn = Rotation.from_rotvec(np.radians(turn_deg)).as_matrix()
    return Transform.from_parts(turn, middle + np.array(shift) - turn @ middle)


def test_nothing_measured_predicts_nothing():
    assert np.array_equal(predict_body([], HOLES).matrix, np.eye(4))


@pytest.mark.parametrize("count", [1, 3, 6, 11])
def test_the_next_hole_is_predicted_better_than_the_plan_has_it(count):
    truth = displaced([0.05, -0.08, 0.06], [0.7, -0.5, 0.4])
    rng = np.random.default_rng(count)
    seen = [measured(n, truth @ PLACES[n] + rng.normal(0, 0.06, 3)) for n in range(count)]
    predicted = predict_body(seen, HOLES)
    last = PLACES[-1]
    off = np.linalg.norm(predicted @ last - truth @ last)
    assert off < {1: 0.9, 3: 0.6, 6: 0.3, 11: 0.2}[count] * np.linalg.norm(last - truth @ last)


def test_one_hole_far_out_does_not_carry_the_body_away():
    truth = displaced([0.0, 0.05, 0.0], [0.5, 0.5, -0.5])
    seen = [measured(n, truth @ PLACES[n]) for n in range(8)]
    seen[3] = measured(3, truth @ PLACES[3] + [4.0, -3.0, 0.0])
    predicted = predict_body(seen, HOLES)
    assert np.linalg.norm(predicted @ PLACES[10] - truth @ PLACES[10]) < 0.3


def test_a_hole_that_the_plan_does_not_know_is_left_out():
    stranger = measured(0, np.zeros(3))
    object.__setattr__(stranger, "hole_id", "X9")
    assert np.array_equal(predict_body([stranger], HOLES).matrix, np.eye(4))
