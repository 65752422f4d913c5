"""An ellipse in the image, held so that a circle is nothing special.

A point at the parameter t is `centre + shape @ (cos t, sin t)` with a symmetric 2x2 `shape`, so
five numbers move it smoothly: where the usual angle of the long axis means nothing at a circle,
`shape` is just a multiple of one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cell.core.geometry import Array, cross
from cell.core.optics import CameraModel

X_AXIS, Y_AXIS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in pixels: `centre` (2,) and symmetric, positive definite `shape` (2, 2)."""

    centre: Array
    shape: Array

    @classmethod
    def circle(cls, x: float, y: float, radius: float) -> Ellipse:
        """Build a circle (px)."""
        return cls(np.array([x, y]), radius * np.eye(2))

    @classmethod
    def through(cls, points: ArrayLike) -> Ellipse:
        """Build from the points (n, 2) of an ellipse spaced evenly in its parameter t."""
        located = np.asarray(points, dtype=np.float64)
        centre = located.mean(axis=0)
        away = located - centre
        return cls(centre, _root(2.0 / len(away) * away.T @ away))

    @property
    def radius(self) -> float:
        """The mean of the semi-axes, px."""
        return float(np.trace(self.shape)) / 2.0

    @property
    def axes(self) -> tuple[float, float, float]:
        """Semi-major and semi-minor axis (px) and the angle of the major one to x (rad)."""
        (minor, major), vectors = np.linalg.eigh(self.shape)
        return float(major), float(minor), float(np.arctan2(vectors[1, 1], vectors[0, 1]))

    def points(self, t: Array) -> Array:
        """Give the points (n, 2) at the parameters t (n,)."""
        return self.centre + _circle(t) @ self.shape

    def normals(self, t: Array) -> Array:
        """Give the unit outward normals (n, 2) at the parameters t (n,)."""
        (a, b), (_, c) = self.shape
        outward = _circle(t) @ np.array([[c, -b], [-b, a]])  # the inverse, but for its scale
        return outward / np.hypot(outward[:, :1], outward[:, 1:])

    def design(self, t: Array) -> Array:
        """Give how far the ellipse moves along its normals (n, 5) for each of its five numbers.

        The columns are centre x and y and the elements 00, 01 and 11 of the shape.
        """
        (cos, sin), normals = _circle(t).T, self.normals(t)
        rows, (n_x, n_y) = np.empty((len(t), 5)), normals.T
        rows[:, :2], rows[:, 2], rows[:, 4] = normals, n_x * cos, n_y * sin
        rows[:, 3] = n_x * sin + n_y * cos
        return rows

    def moved(self, step: Array) -> Ellipse:
        """Move by the five numbers of `design`."""
        x, y, s00, s01, s11 = step
        return Ellipse(self.centre + np.array([x, y]),
                       self.shape + np.array([[s00, s01], [s01, s11]]))

    def scaled(self, factor: float) -> Ellipse:
        """Make it so many times as large about its centre."""
        return Ellipse(self.centre, factor * self.shape)

    def reach(self, points: ArrayLike) -> Array:
        """Measure where points (n, 2) lie: below 1 inside, 1 on the ellipse, above 1 outside."""
        return np.linalg.norm(self.inward(points), axis=-1)

    def inward(self, points: ArrayLike) -> Array:
        """Carry points (n, 2) to where the ellipse is the unit circle: (cos t, sin t) on it."""
        away = np.asarray(points, dtype=np.float64) - self.centre
        return np.asarray(away @ np.linalg.inv(self.shape))


def project_circle(camera: CameraModel, centre: Array, normal: Array, radius: float) -> Ellipse:
    """Project the circle around `centre` (3,) mm, through lens and distortion, to pixels."""
    u = cross(normal, Y_AXIS if abs(normal[1]) < abs(normal[0]) else X_AXIS)
    u = u / np.linalg.norm(u)
    v = cross(normal / np.linalg.norm(normal), u)
    return Ellipse.through(camera.project(centre + radius * ROUND @ np.stack([u, v])))


def _circle(t: Array) -> Array:
    both = np.empty((len(t), 2))
    both[:, 0], both[:, 1] = np.cos(t), np.sin(t)
    return both


ROUND = _circle(np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False))


def _root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(values)) @ vectors.T
