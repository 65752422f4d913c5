"""What the two-step method errs by when the hole is tilted (paper, section 5), and in general.

| symbol | meaning | unit | source |
|---|---|---|---|
| L | working distance: z where optic axis and light plane meet | mm | 5 (1) |
| alpha | angle between optic axis and light plane | rad | 5 (1) |
| x_d, y_d | x and y of the circle's centre | mm | 5 (2), (3) |
| z_d | z of the circle's centre less L | mm | 5 (4) |
| beta | tilt: the circle's plane runs along (cos beta, sin beta) in x and z | rad | 5.1 |
| dx, dy, dz | measured less true coordinate | mm | (15), (17), (20) |
| m, n | unit normals of the light plane and of the circle's plane | - | general form |
| s | signed distance of the circle's centre from the light plane | mm | general form |
| C, Q | the circle's centre, the midpoint of the chord | mm | 3.1 |

The paper's forms assume a light plane `x + (z - L) tan(alpha) = 0` and a tilt about y alone. (19)
is misprinted, its leading minus is missing; (20) has it. L and alpha always come from the light
plane: the values in the paper's text belong to another calibration than the plane that it prints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cell.core.geometry import Array, Plane

WELL_CROSSED = 0.8  # of the radius: how far from the centre the stripe may pass


@dataclass(frozen=True)
class SensorGeometry:
    """The two numbers of a sensor that the error model knows: L in mm and alpha in rad."""

    L: float
    alpha: float

    @classmethod
    def from_light_plane(cls, light_plane: Plane) -> SensorGeometry:
        """Derive L and alpha from the light plane in the camera frame."""
        normal = light_plane.normal
        return cls(-light_plane.offset / float(normal[2]), float(np.arcsin(abs(normal[2]))))


def error_z(sensor: SensorGeometry, x_d: ArrayLike, z_d: ArrayLike, beta: ArrayLike) -> Array:
    """Compute dz in mm by equation (15)."""
    tan_alpha, tan_beta = np.tan(sensor.alpha), np.tan(beta)
    distance = np.asarray(x_d) + np.asarray(z_d) * tan_alpha
    return np.asarray(-distance / (1 + tan_alpha * tan_beta) * tan_beta)


def error_x(sensor: SensorGeometry, x_d: ArrayLike, z_d: ArrayLike, beta: ArrayLike) -> Array:
    """Compute dx in mm by equation (17): x_d dz / (L + z_d)."""
    return np.asarray(x_d) * error_z(sensor, x_d, z_d, beta) / (sensor.L + np.asarray(z_d))


def error_y(sensor: SensorGeometry, centre: tuple[ArrayLike, ArrayLike, ArrayLike],
            beta: ArrayLike) -> Array:
    """Compute dy in mm by equation (20) at `centre` = (x_d, y_d, z_d): y_d dz / (L + z_d)."""
    x_d, y_d, z_d = centre
    return np.asarray(y_d) * error_z(sensor, x_d, z_d, beta) / (sensor.L + np.asarray(z_d))


def chord_midpoint_error(light_plane: Plane, centre: ArrayLike, normal: ArrayLike) -> Array:
    """Compute Q - C (..., 3) in mm for tilt about both axes: its z is the error dz, exactly.

    `centre` (..., 3) and `normal` (..., 3) of the circle in the camera frame. The midpoint of the
    chord is the foot of the centre on the line in which the two planes meet.
    """
    m, n = light_plane.normal, np.asarray(normal, dtype=np.float64)
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    cosine = (n @ m)[..., None]
    s = light_plane.distance(centre)[..., None]
    return -s * (m - n * cosine) / (1 - cosine**2)


def two_step_error(light_plane: Plane, centre: ArrayLike, normal: ArrayLike,
                   radius: float) -> Array:
    """Compute what the two-step method errs by in x, y, z and the radius (..., 4), mm, at any tilt.

    Exact but for the radius, which is so to the second order of the error of the centre.
    """
    c = np.asarray(centre, dtype=np.float64)
    to_chord = chord_midpoint_error(light_plane, c, normal)
    beside = _eccentricity(c, normal, radius)
    error = beside + (c + beside) * to_chord[..., 2:] / c[..., 2:]
    chordwise = np.sum(to_chord * error, axis=-1, keepdims=True)
    square = np.sum(error * error, axis=-1, keepdims=True)
    return np.concatenate([error, (square / 2.0 - chordwise) / radius], axis=-1)


@dataclass(frozen=True)
class Ranges:
    """How far x_d, y_d, z_d (mm) and the tilt (rad) may lie from zero, either way."""

    x: float = 5.0
    y: float = 5.0
    z: float = 5.0
    tilt: float = float(np.radians(2.0))


def paper_extremes(sensor: SensorGeometry, ranges: Ranges) -> Array:
    """Find the largest |dx|, |dy| and |dz| (3,) in mm that (17), (20) and (15) allow."""
    ends = [np.array([-1.0, 0.0, 1.0]) * reach for reach in (ranges.x, ranges.y, ranges.z)]
    x_d, y_d, z_d, beta = np.meshgrid(*ends, np.array([-1.0, 1.0]) * ranges.tilt)
    errors = [error_x(sensor, x_d, z_d, beta), error_y(sensor, (x_d, y_d, z_d), beta),
              error_z(sensor, x_d, z_d, beta)]
    return np.array([np.abs(error).max() for error in errors])


def general_extremes(light_plane: Plane, ranges: Ranges, radius: float) -> Array:
    """Find the largest errors of x, y, z and the radius (4,) in mm for a tilt in any direction.

    Counted are holes that the stripe crosses well: within `WELL_CROSSED` of the radius.
    """
    steps = np.linspace(-1.0, 1.0, 9)
    L = SensorGeometry.from_light_plane(light_plane).L
    x, y, z, way = np.meshgrid(steps * ranges.x, steps * ranges.y, L + steps * ranges.z,
                               np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False))
    centre = np.stack([x, y, z], axis=-1)
    flat, steep = np.sin(ranges.tilt), -np.cos(ranges.tilt)
    normal = np.stack([flat * np.cos(way), flat * np.sin(way), np.full_like(way, steep)], axis=-1)
    away = np.linalg.norm(chord_midpoint_error(light_plane, centre, normal), axis=-1)
    errors = np.abs(two_step_error(light_plane, centre, normal, radius))
    return np.asarray(errors[away < WELL_CROSSED * radius].max(axis=0))


def _eccentricity(c: Array, normal: ArrayLike, radius: float) -> Array:
    """How far the ellipse's centre, carried to the circle's z, lies from the circle's centre.

    The circle's dual conic is C Cᵀ - r² (I - n nᵀ); its product with the z axis is the ray to the
    ellipse's centre.
    """
    n = np.asarray(normal, dtype=np.float64)
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    ray = c * c[..., 2:] - radius**2 * (np.array([0.0, 0.0, 1.0]) - n * n[..., 2:])
    return np.asarray(ray * c[..., 2:] / ray[..., 2:] - c)
