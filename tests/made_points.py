"""Exact point data of tilted holes: rim and stripe points as a perfect detector would give them.

Rays are met with planes here and projected through the core's lens; nothing of the estimators is
used. The truth is shifted and tilted against every belief.
"""

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Plane
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.features import Expected, Rim, Stripe

MATRIX = np.array([[3484.78278, 0.0, 310.046518], [0.0, 3472.023859, 312.197608], [0.0, 0.0, 1.0]])
DISTORTION = np.array([0.299731, 3.218002, 0.013074, -0.023963, 0.0])
CAMERA = CameraModel((768, 576), MATRIX, DISTORTION)
L, ALPHA = 253.0417, np.radians(20.7712)
TAN = np.tan(ALPHA)

SENSOR_A = SensorModel(CAMERA, Plane.from_coefficients([1.0, -0.000395, 0.555042, -134.560160]))
SENSOR_B = SensorModel(CAMERA, Plane.from_coefficients([1.0, 0.0, TAN, -L * TAN]))


@dataclass(frozen=True, eq=False)
class Noise:
    """What disturbs the points: px of edge and stripe, form (rms of waves 2 to 4, mm), bias px."""

    edge: float = 0.0
    stripe: float = 0.0
    form: float = 0.0
    bias: float = 0.0


@dataclass(frozen=True, eq=False)
class TrueHole:
    """A circle in the camera frame."""

    centre: np.ndarray
    normal: np.ndarray
    radius: float

    def distance(self, plane):
        """The signed distance of the centre from a plane."""
        return float(plane.distance(self.centre))


def tilted(b_deg, g_deg):
    """A unit normal towards the camera, leaning by b about y and g about x."""
    normal = np.array([np.tan(np.radians(b_deg)), np.tan(np.radians(g_deg)), -1.0])
    return normal / np.linalg.norm(normal)


def in_plane(normal):
    """Two unit vectors (2, 3) across a normal."""
    return np.linalg.svd(np.asarray(normal)[None])[2][1:]


def waver(normal, sigma, rng):
    """A normal off by a random turn of `sigma` rad per tangent axis."""
    turned = normal + sigma * rng.normal(size=2) @ in_plane(normal)
    return turned / np.linalg.norm(turned)


def rim_points(hole, noise, rng, camera=CAMERA, arc=(0.0, 2 * np.pi)):
    """Points on the rim, one a pixel, in px, and their directions into the hole."""
    count = int((arc[1] - arc[0]) * hole.radius / hole.centre[2] * camera.matrix[0, 0])
    t = np.linspace(*arc, count, endpoint=False)
    rho = np.full(count, hole.radius)
    for wave in (2, 3, 4):
        a, b = rng.normal(0.0, noise.form / np.sqrt(3.0), 2)
        rho += a * np.cos(wave * t) + b * np.sin(wave * t)
    first, second = in_plane(hole.normal)
    points = camera.project(hole.centre + rho[:, None] * (
        np.cos(t)[:, None] * first + np.sin(t)[:, None] * second))
    inward = camera.project(hole.centre) - points
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    return points + inward * rng.normal(0.0, noise.edge, count)[:, None], inward


def stripe_points(hole, sensor, noise, rng, reach=10.0, skip=0.7):
    """Points of the stripe on both sides of the hole, one a pixel, and their sides."""
    m, n = sensor.light_plane.normal, hole.normal
    along = np.cross(n, m) / np.linalg.norm(np.cross(n, m))
    s = hole.distance(sensor.light_plane)
    foot = hole.centre - s * (m - n * (n @ m)) / (1 - (n @ m) ** 2)
    half = np.sqrt(max(0.0, hole.radius**2 - np.sum((foot - hole.centre) ** 2)))
    count = int(reach / hole.centre[2] * sensor.camera.matrix[1, 1])
    way = half + skip + np.linspace(0.0, reach, count)
    side = np.repeat([-1.0, 1.0], count)
    points = sensor.camera.project(foot + (side * np.tile(way, 2))[:, None] * along)
    step = sensor.camera.project(foot + along) - sensor.camera.project(foot)
    across = np.array([-step[1], step[0]]) / np.linalg.norm(step)
    off = rng.normal(0.0, noise.stripe, 2 * count) + rng.normal(0.0, noise.bias)
    return points + off[:, None] * across, side


def make_rim(hole, noise, rng, sigma=None, **more):
    """The rim as detection hands it over; `sigma` px where it is not the noise's."""
    points, inward = rim_points(hole, noise, rng, **more)
    x, y = points.mean(axis=0)
    r = float(np.linalg.norm(points - (x, y), axis=1).mean())
    return Rim(points, inward, sigma or noise.edge or 0.01, 1.0, (x, y, r, r, 0.0))


def make_stripe(hole, sensor, noise, rng, **more):
    """The stripe as detection hands it over."""
    points, side = stripe_points(hole, sensor, noise, rng, **more)
    return Stripe(points, side, noise.stripe or 0.01, 1.0, noise.bias or 0.001)


def make_pair(hole, sensor, noise, rng):
    """Rim and stripe of one hole."""
    return make_rim(hole, noise, rng), make_stripe(hole, sensor, noise, rng)


def plan_of(hole, normal_sigma, rng, radius_sigma=0.03):
    """What a plan knows of a hole: a normal and a radius that are a little off."""
    return Expected(normal=waver(hole.normal, normal_sigma, rng), normal_sigma=normal_sigma,
                    radius=hole.radius + rng.normal(0.0, radius_sigma))


def conic_of_circle(centre, normal, radius):
    """Project a circle (centre and normal (3,) in the camera frame, mm) to its conic (3, 3)."""
    c, n = np.asarray(centre), np.asarray(normal) / np.linalg.norm(normal)
    # A ray u meets the plane in X = u (n·c)/(n·u); |X - c| = r becomes quadratic in u.
    back = (n @ c) * np.eye(3) - np.outer(c, n)
    return back.T @ back - radius**2 * np.outer(n, n)
