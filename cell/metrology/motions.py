"""Stacks of rigid motions, and small motions to first order.

A stack is (n, 4, 4). A small motion is (6,): a rotation vector (rad), then a translation (mm).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array, Transform


def stack(transforms: Iterable[Transform]) -> Array:
    """Stack transforms: (n, 4, 4)."""
    return np.array([transform.matrix for transform in transforms]).reshape(-1, 4, 4)


def inverse(motions: Array) -> Array:
    """Invert a stack (..., 4, 4)."""
    back = np.zeros_like(motions)
    back[..., :3, :3] = np.swapaxes(motions[..., :3, :3], -1, -2)
    back[..., :3, 3] = -np.einsum("...ij,...j->...i", back[..., :3, :3], motions[..., :3, 3])
    back[..., 3, 3] = 1.0
    return back


def rotation_vectors(motions: Array) -> Array:
    """Take the rotation vectors (n, 3) in rad of a stack."""
    return Rotation.from_matrix(motions[:, :3, :3]).as_rotvec()


def small(motions: Array) -> Array:
    """Read motions near the identity as small motions (n, 6)."""
    return np.hstack([rotation_vectors(motions), motions[:, :3, 3]])


def hat(vectors: ArrayLike) -> Array:
    """Build the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, -2)


def adjoint(motions: Array) -> Array:
    """Build (..., 6, 6) that carries a small motion in frame b to frame a, for `a_from_b`."""
    rotation, translation = motions[..., :3, :3], motions[..., :3, 3]
    matrix = np.zeros((*motions.shape[:-2], 6, 6))
    matrix[..., :3, :3] = matrix[..., 3:, 3:] = rotation
    matrix[..., 3:, :3] = hat(translation) @ rotation
    return matrix


def nudge(transform: Transform, step: Array) -> Transform:
    """Turn by a small rotation about the transform's own origin and shift it (axes of a)."""
    turn = Rotation.from_rotvec(step[:3]).as_matrix()
    return Transform.from_parts(turn @ transform.rotation, transform.translation + step[3:])


def nudge_as_motion(transform: Transform) -> Array:
    """Build (6, 6) that carries a `nudge` of the transform to the small motion of frame a."""
    matrix = np.eye(6)
    matrix[3:, :3] = hat(transform.translation)
    return matrix


def point_shift(points: Array) -> Array:
    """Build (n, 3, 6): how points (n, 3), relative to the nudged origin, move with a nudge."""
    identity = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([-hat(points), identity], axis=2)


def lay_onto(points: Array, others: Array) -> Transform:
    """Solve the rigid motion that lays points (n, 3) of frame b onto the same in frame a.

    Least squares; S. Umeyama, IEEE PAMI 13 (1991) 376, without scale.
    """
    middle, other_middle = points.mean(axis=0), others.mean(axis=0)
    rotation = nearest_rotation((others - other_middle).T @ (points - middle))
    return Transform.from_parts(rotation, other_middle - rotation @ middle)


def nearest_rotation(matrix: Array) -> Array:
    """Find the rotation nearest to a 3x3 matrix in the Frobenius norm."""
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
