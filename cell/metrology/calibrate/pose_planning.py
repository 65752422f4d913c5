"""Which views to take: chosen one by one, so that each lowers the predicted uncertainty most.

What a view tells depends on geometry alone, so it is known before the robot moves. Diversity beats
count: eight chosen poses do what fifteen random ones do.
"""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Transform
from cell.metrology.calibrate.hand_eye.solve import UNKNOWNS, HandEyeProblem, view_information
from cell.metrology.calibrate.working_volume import point_sigma, volume_shift

BELIEF = np.repeat([np.radians(10.0), 20.0], 3)
"""What a drawing tells of the camera's mount: standard uncertainty, three rad, three mm."""
BOARD_BELIEF = np.repeat([np.radians(45.0), 500.0], 3)


def plan_views(candidates: HandEyeProblem, carrier_from_camera: Transform,
               reference_from_board: Transform, working_distance: float, count: int) -> list[int]:
    """Choose `count` of the candidate views, in the order in which they help most.

    `candidates` hold wanted robot poses and the board poses predicted for them; both transforms
    are beliefs, good to centimetres.
    """
    tells = view_information(candidates, carrier_from_camera, reference_from_board)
    shift = volume_shift(carrier_from_camera, working_distance)
    weight = np.einsum("nij,nik->jk", shift, shift)
    known, chosen = prior_information(), list[int]()
    for _ in range(min(count, len(tells))):
        spread = np.linalg.inv(known + tells)[:, :6, :6]
        cost = np.einsum("nij,ji->n", spread, weight)
        cost[chosen] = np.inf
        chosen.append(int(np.argmin(cost)))
        known = known + tells[chosen[-1]]
    return chosen


def predict_point_sigma(views: HandEyeProblem, carrier_from_camera: Transform,
                        reference_from_board: Transform, working_distance: float) -> float:
    """Predict the point uncertainty (mm, rms in 3D) after these views."""
    tells = view_information(views, carrier_from_camera, reference_from_board).sum(axis=0)
    covariance = np.linalg.inv(prior_information() + tells)[:6, :6]
    return point_sigma(covariance, carrier_from_camera, working_distance)


def prior_information() -> Array:
    """Form the information (12, 12) of what is believed before the first view."""
    return np.diag(np.concatenate([BELIEF, BOARD_BELIEF]) ** -2.0).reshape(UNKNOWNS, UNKNOWNS)
