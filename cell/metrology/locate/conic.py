"""Conics and lines of the image, in normalised coordinates (x, y, 1): rays of the camera.

A conic is the symmetric 3x3 matrix K of `u^T K u = 0`; a circle in space projects to one exactly,
so that nothing here is an approximation. A line is (n_x, n_y, c) of `n · u + c = 0` with unit n: it
has no direction in which it is singular, unlike y = k x + l (paper, equation 4).
"""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array
from cell.metrology.reasons import refusal
from cell.metrology.spread import middle

SAMPSON_STEPS = 3  # reweightings: the algebraic distance becomes the geometric one
HUBER_STEPS = 3
HUBER = 1.5  # residuals beyond so many robust standard deviations weigh less
MAD_TO_SIGMA = 1.4826


def fit_conic(points: Array) -> Array:
    """Fit a conic (3, 3) to points (n, 2) by least squares of their Sampson distance.

    Raises:
        UnmeasurableError: fewer than five points (`no_hole`), or no ellipse lies through them
                (`not_round`).
    """
    if len(points) < 5:
        raise refusal("no_hole", f"{len(points)} points on the rim, five make a conic")
    mean, scale = points.mean(axis=0), float(points.std())
    to_unit = np.array([[1 / scale, 0, -mean[0] / scale], [0, 1 / scale, -mean[1] / scale],
                        [0, 0, 1]])
    x, y = ((points - mean) / scale).T
    monomials = np.stack([x * x, 2 * x * y, y * y, 2 * x, 2 * y, np.ones_like(x)], axis=1)
    k = _least(monomials)
    for _ in range(SAMPSON_STEPS):
        slope = np.hypot(k[0] * x + k[1] * y + k[3], k[1] * x + k[2] * y + k[4])
        k = _least(monomials / slope[:, None])
    unit = np.array([[k[0], k[1], k[3]], [k[1], k[2], k[4]], [k[3], k[4], k[5]]])
    conic = to_unit.T @ unit @ to_unit
    if np.linalg.det(conic[:2, :2]) <= 0:
        raise refusal("not_round", "the conic through the rim's points is no ellipse")
    return np.asarray(conic * np.sign(np.trace(conic[:2, :2])))


def ellipse_centre(conic: Array) -> Array:
    """Find the centre (2,) of the ellipse: not the image of the circle's centre when tilted."""
    return np.asarray(np.linalg.solve(conic[:2, :2], -conic[:2, 2]))


def circle_centre_ray(conic: Array, normal: Array) -> Array:
    """Find the ray (3,), z = 1, to the circle's centre: K^-1 n, the pole of the plane's horizon."""
    ray = np.linalg.solve(conic, normal)
    return np.asarray(ray / ray[2])


def chord(conic: Array, line: Array) -> tuple[Array, Array]:
    """Intersect an ellipse with a line (n_x, n_y, c): the chord's two ends A and B (2,).

    Raises:
        UnmeasurableError: the line does not cross the ellipse (`laser_misses_hole`).
    """
    foot, along = -line[2] * line[:2], np.array([-line[1], line[0]])
    p, d = np.append(foot, 1.0), np.append(along, 0.0)
    a, half_b, c = d @ conic @ d, d @ conic @ p, p @ conic @ p
    discriminant = half_b**2 - a * c
    if discriminant <= 0:
        raise refusal("laser_misses_hole")
    root = np.sqrt(discriminant)
    return foot + along * (-half_b - root) / a, foot + along * (-half_b + root) / a


def fit_line(points: Array) -> Array:
    """Fit a line (n_x, n_y, c) to points (n, 2) by orthogonal distance, Huber-weighted.

    Raises:
        UnmeasurableError: fewer than two points (`no_laser`).
    """
    if len(points) < 2:
        raise refusal("no_laser", f"{len(points)} points on the stripe, two make a line")
    line = _line_through(points, np.ones(len(points)))
    for _ in range(HUBER_STEPS):
        distance = np.abs(points @ line[:2] + line[2])
        limit = HUBER * MAD_TO_SIGMA * middle(distance) + np.finfo(float).tiny
        line = _line_through(points, np.minimum(1.0, limit / np.maximum(distance, limit)))
    return line


def _line_through(points: Array, weights: Array) -> Array:
    mean = weights @ points / weights.sum()
    offsets = points - mean
    normal = _least(offsets * np.sqrt(weights)[:, None])
    return np.append(normal, -normal @ mean)


def _least(rows: Array) -> Array:
    """Find the unit vector for which the squares of `rows` add up to least."""
    return np.asarray(np.linalg.eigh(rows.T @ rows)[1][:, 0])
