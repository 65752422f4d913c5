"""Rigid transforms and planes, in mm and radians.

A transform is named `a_from_b`: it takes a point known in frame b and gives it in frame a, so that
equal names touch: `body_from_base @ base_from_flange @ flange_from_camera`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array: TypeAlias = NDArray[np.float64]

ROTATION_TOLERANCE = 1e-6  # of R Rᵀ = 1; what printing a matrix with seven digits costs

UNTURNED = np.eye(3)


def cross(first: Array, second: Array) -> Array:
    """Multiply two vectors (3,): the vector product, at a fraction of the cost of `np.cross`."""
    a, b, c = first.tolist()
    x, y, z = second.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


@dataclass(frozen=True, eq=False)
class Transform:
    """A rigid motion, held as the 4x4 matrix that it was given: so it survives a recording."""

    matrix: Array

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError("a transform is a finite 4x4 matrix")
        if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise ValueError("the last row of a transform is 0 0 0 1")
        rotation = matrix[:3, :3]
        if np.abs(rotation @ rotation.T - UNTURNED).max() > ROTATION_TOLERANCE:
            raise ValueError("the upper left 3x3 of a transform is a rotation: its rows are "
                             "orthogonal unit vectors")
        if rotation[2] @ cross(rotation[0], rotation[1]) < 0:
            raise ValueError("the upper left 3x3 of a transform is a rotation, not a mirror image")
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def identity(cls) -> Transform:
        """Return the motion that leaves every point where it is."""
        return cls(np.eye(4))

    @classmethod
    def from_parts(cls, rotation: ArrayLike, translation: ArrayLike) -> Transform:
        """Build from a rotation (3x3, or rotation vector (3,) in rad) and a translation (mm)."""
        turn = np.asarray(rotation, dtype=np.float64)
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_rotvec(turn).as_matrix() if turn.shape == (3,) else turn
        matrix[:3, 3] = translation
        return cls(matrix)

    @property
    def rotation(self) -> Array:
        """The 3x3 rotation matrix."""
        return self.matrix[:3, :3]

    @property
    def translation(self) -> Array:
        """The translation (3,) in mm: where the origin of b lies in a."""
        return self.matrix[:3, 3]

    @cached_property
    def rotation_vector(self) -> Array:
        """The rotation vector (3,) in rad (axis times angle)."""
        return Rotation.from_matrix(self.rotation).as_rotvec()

    @property
    def inverse(self) -> Transform:
        """The motion back: `b_from_a` of `a_from_b`."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation.T
        matrix[:3, 3] = -self.rotation.T @ self.translation
        return Transform(matrix)

    @overload
    def __matmul__(self, other: Transform) -> Transform: ...
    @overload
    def __matmul__(self, other: Array) -> Array: ...
    def __matmul__(self, other: Transform | Array) -> Transform | Array:
        """Compose with a transform, or carry points (..., 3) from frame b to frame a."""
        if isinstance(other, Transform):
            return Transform(self.matrix @ other.matrix)
        return np.asarray(other) @ self.rotation.T + self.translation

    def turn(self, directions: ArrayLike) -> Array:
        """Carry directions (..., 3) from frame b to frame a: the rotation alone."""
        return np.asarray(directions, dtype=np.float64) @ self.rotation.T

    def distance(self, other: Transform) -> tuple[float, float]:
        """Measure how far `other` is: (mm between the origins, rad between the orientations)."""
        millimetres = float(np.linalg.norm(self.translation - other.translation))
        # The chord of the rotation is accurate near zero, where acos of the trace is not.
        chord = np.linalg.norm(self.rotation - other.rotation) / np.sqrt(8.0)
        return millimetres, float(2.0 * np.arcsin(min(1.0, float(chord))))


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane `normal · X + offset = 0`, with a unit normal (3,); mm."""

    normal: Array
    offset: float

    @classmethod
    def from_coefficients(cls, coefficients: ArrayLike) -> Plane:
        """Build from a, b, c, d of a x + b y + c z + d = 0, which need not be normalised."""
        abcd = np.asarray(coefficients, dtype=np.float64)
        length = float(np.linalg.norm(abcd[:3]))
        if abcd.shape != (4,) or not np.isfinite(abcd).all() or length == 0.0:
            raise ValueError("a plane has four finite coefficients, the first three not all zero")
        return cls(abcd[:3] / length, float(abcd[3] / length))

    @classmethod
    def through(cls, point: ArrayLike, normal: ArrayLike) -> Plane:
        """Build from a point (3,) on the plane and its normal (3,)."""
        unit = np.asarray(normal, dtype=np.float64)
        unit = unit / np.linalg.norm(unit)
        return cls(unit, -float(unit @ np.asarray(point, dtype=np.float64)))

    def distance(self, points: ArrayLike) -> Array:
        """Measure the signed distance of points (..., 3), positive on the normal's side."""
        return np.asarray(points, dtype=np.float64) @ self.normal + self.offset

    def meet(self, rays: ArrayLike) -> Array:
        """Intersect rays (..., 3) through the origin with the plane: points (..., 3).

        A ray along the plane gives non-finite coordinates.
        """
        directions = np.asarray(rays, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            return directions * (-self.offset / (directions @ self.normal))[..., None]
