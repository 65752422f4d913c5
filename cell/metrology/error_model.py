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

    To second order in the tilt. The ray to the ellipse's centre passes r² sin t cos t / d beside
    the circle's centre, t being the angle between normal and viewing ray and d the distance.
    """
    c = np.asarray(centre, dtype=np.float64)
    to_chord = chord_midpoint_error(light_plane, c, normal)
    error = c * to_chord[..., 2:] / c[..., 2:] + _eccentricity(c, normal, radius)
    chordwise = np.sum(to_chord * error, axis=-1, keepdims=True)
    square = np.sum(error * error, axis=-1, keepdims=True)
    return np.concatenate([error, (square / 2.0 - chordwise) / radius], axis=-1)


def _eccentricity(c: Array, normal: ArrayLike, radius: float) -> Array:
    """How far the back-projected centre of the ellipse lies from the circle's, at equal z."""
    n = np.asarray(normal, dtype=np.float64)
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    distance = np.linalg.norm(c, axis=-1, keepdims=True)
    view = c / distance
    cosine = np.sum(view * n, axis=-1, keepdims=True)
    shift = radius**2 * cosine * (n - view * cosine) / distance
    return np.asarray(shift - view * shift[..., 2:] / view[..., 2:])
