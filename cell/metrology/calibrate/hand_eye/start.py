"""Hand-eye in closed form, on all pairs of views: the start of the fit and its cross-check.

F. Park, B. Martin, IEEE Trans. Robotics and Automation 10 (1994) 717, with the rotation by singular
value decomposition, which never ends in a mirror image.

| symbol | meaning | unit |
|---|---|---|
| A | `carrier_from_carrier`, the robot's motion between two views | mm |
| B | `camera_from_camera`, the motion of the camera against the board | mm |
| X | `carrier_from_camera`: A X = X B | mm |
"""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Transform
from cell.metrology.motions import inverse, nearest_rotation, rotation_vectors

LEAST_TURN, MOST_TURN = np.radians((10.0, 170.0))
"""A pair that turns less says little of X, one that turns more has no certain axis."""


def solve_park(reference_from_carrier: Array, camera_from_board: Array) -> Transform:
    """Solve `carrier_from_camera` from stacks (n, 4, 4) of reached poses and board poses."""
    A, B = useful_pairs(reference_from_carrier, camera_from_board)
    rotation = nearest_rotation(rotation_vectors(A).T @ rotation_vectors(B))
    return Transform.from_parts(rotation, _translation(A, B, rotation))


def pairs(reference_from_carrier: Array, camera_from_board: Array) -> tuple[Array, Array]:
    """Form the motions A and B (m, 4, 4) of all pairs of views."""
    i, j = np.triu_indices(len(reference_from_carrier), 1)
    A = inverse(reference_from_carrier[j]) @ reference_from_carrier[i]
    B = camera_from_board[j] @ inverse(camera_from_board[i])
    return A, B


def useful_pairs(reference_from_carrier: Array, camera_from_board: Array) -> tuple[Array, Array]:
    """Form the motions of the pairs that turn enough; of all of them where hardly any does."""
    A, B = pairs(reference_from_carrier, camera_from_board)
    turns = np.linalg.norm(rotation_vectors(A), axis=1)
    use = (turns > LEAST_TURN) & (turns < MOST_TURN)
    return (A[use], B[use]) if use.sum() >= 3 else (A, B)


def _translation(A: Array, B: Array, rotation: Array) -> Array:
    rows = (A[:, :3, :3] - np.eye(3)).reshape(-1, 3)
    shift = B[:, :3, 3] @ rotation.T - A[:, :3, 3]
    return np.asarray(np.linalg.lstsq(rows, shift.ravel(), rcond=None)[0], dtype=np.float64)
