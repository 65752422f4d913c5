"""Predict where a body lies from the holes measured so far, so that the next stop is centred."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.documents.nominals import Hole
from cell.core.documents.result import Measured
from cell.core.geometry import Array, Transform

SHIFT_SIGMA = 1.0  # mm: how far a fixture leaves a body from its place
TURN_SIGMA = 0.0015  # rad, per axis
HOLE_SIGMA = 0.2  # mm: what holes deviate by of themselves
HUBER = 2.0
STEPS = 6


def predict_body(measured: Sequence[Measured], holes: Sequence[Hole]) -> Transform:
    """Predict `body_from_predicted`: from where the drawing has a point to where it is expected.

    Least squares over a small turn about the middle of all holes and a shift, with the fixture's
    play as prior: one hole gives a shift, more of them a turn too; one hole that is far out does
    not carry the body away. The identity where nothing is measured.

    Args:
        measured: the holes measured on this body so far.
        holes: all holes of the plan.
    """
    nominal = {hole.id: hole.centre for hole in holes}
    known = [hole for hole in measured if hole.hole_id in nominal]
    if not known:
        return Transform.identity()
    middle = np.mean(list(nominal.values()), axis=0)
    arms = np.array([nominal[hole.hole_id] for hole in known]) - middle
    moved = np.array([hole.centre for hole in known]) - middle - arms
    variance = np.array([np.diag(hole.covariance)[:3] for hole in known]) + HOLE_SIGMA**2
    turn, shift = np.split(_solve(arms, moved, variance), 2)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return Transform.from_parts(rotation, middle + shift - rotation @ middle)


def _solve(arms: Array, moved: Array, variance: Array) -> Array:
    """Find the turn (rad) and shift (mm), (6,), that explain how far the holes have moved."""
    x, y, z = arms.T
    none = np.zeros_like(x)
    crossed = np.stack([np.stack(row, axis=-1) for row in
                        ([none, z, -y], [-z, none, x], [y, -x, none])], axis=-2)
    rows = np.concatenate([crossed, np.broadcast_to(np.eye(3), crossed.shape)], axis=-1)
    prior = np.diag([TURN_SIGMA**-2] * 3 + [SHIFT_SIGMA**-2] * 3)
    answer = np.zeros(6)
    for _ in range(STEPS):
        off = np.linalg.norm((moved - rows @ answer) / np.sqrt(variance), axis=-1)
        weight = np.minimum(1.0, HUBER / np.maximum(off, HUBER))[:, None] / variance
        information = np.einsum("nia,ni,nib->ab", rows, weight, rows) + prior
        answer = np.linalg.solve(information, np.einsum("nia,ni,ni->a", rows, weight, moved))
    return np.asarray(answer)
