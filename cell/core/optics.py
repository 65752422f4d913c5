"""The camera and the sensor: how points in front of the lens become pixels, and back.

Model: pinhole with the Brown-Conrady distortion of OpenCV (k1, k2, p1, p2, k3). Pixel centres lie
at integers, (x, y) with x to the right and y down; the camera frame has z forward.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cell.core.geometry import Array, Plane

ALMOST = 1e-6  # of normalised coordinates: the step from there leaves its square, 1e-12
NEWTON_STEPS = 6  # quadratic: four suffice for the lenses met, two are for the others


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A calibrated camera: image size (width, height), 3x3 matrix in px, distortion (5,).

    `blur` is how soft a sharp edge appears, the standard deviation in px; None where nobody knows.
    """

    image_size: tuple[int, int]
    matrix: Array
    distortion: Array
    blur: float | None = None

    def project(self, points_in_camera: ArrayLike) -> Array:
        """Project points (..., 3) in mm to pixels (..., 2), distortion included."""
        points = np.asarray(points_in_camera, dtype=np.float64)
        normalised = points[..., :2] / points[..., 2:]
        return self.to_pixels(normalised)

    def to_pixels(self, normalised: ArrayLike) -> Array:
        """Distort normalised coordinates (..., 2) and turn them into pixels (..., 2)."""
        x, y = _parts(normalised)
        x_d, y_d = _distort(x, y, self.distortion)
        k = self.matrix
        return _pairs(k[0, 0] * x_d + k[0, 1] * y_d + k[0, 2], k[1, 1] * y_d + k[1, 2])

    def normalise(self, pixels: ArrayLike) -> Array:
        """Undistort pixels (..., 2) to normalised coordinates (..., 2): the ray is (x, y, 1).

        Newton's iteration from the pinhole's answer; OpenCV's function differs by version.
        """
        k = self.matrix
        u, v = _parts(pixels)
        y_d = (v - k[1, 2]) / k[1, 1]
        x_d = (u - k[0, 2] - k[0, 1] * y_d) / k[0, 0]
        x, y = x_d, y_d
        for _ in range(NEWTON_STEPS):
            f, g, by_x, mixed, by_y = _linearise(x, y, self.distortion)
            f, g = f - x_d, g - y_d
            determinant = by_x * by_y - mixed * mixed
            x = x - (by_y * f - mixed * g) / determinant
            y = y - (by_x * g - mixed * f) / determinant
            if max(np.abs(f).max(initial=0.0), np.abs(g).max(initial=0.0)) < ALMOST:
                break
        return _pairs(x, y)

    def normalised_by_pixel(self, normalised: ArrayLike) -> Array:
        """Differentiate normalised coordinates (..., 2) by pixels: matrices (..., 2, 2)."""
        x, y = _parts(normalised)
        _, _, by_x, mixed, by_y = _linearise(x, y, self.distortion)
        back = np.empty((*x.shape, 2, 2))
        back[..., 0, 0], back[..., 1, 1] = by_y, by_x
        back[..., 0, 1] = back[..., 1, 0] = -mixed
        back /= (by_x * by_y - mixed * mixed)[..., None, None]
        return np.asarray(np.dot(back, np.linalg.inv(self.matrix[:2, :2])))

    def pixel_by_intrinsics(self, normalised: ArrayLike) -> Array:
        """Differentiate pixels by fx, fy, cx, cy, k1, k2, p1, p2, k3: matrices (..., 2, 9)."""
        x, y = _parts(normalised)
        x_d, y_d = _distort(x, y, self.distortion)
        r2, xy = x * x + y * y, 2.0 * x * y
        matrices = np.zeros((*x.shape, 2, 9))
        matrices[..., 0, 0], matrices[..., 1, 1] = x_d, y_d
        matrices[..., 0, 2] = matrices[..., 1, 3] = 1.0
        lens = np.stack([x * r2, x * r2**2, xy, r2 + 2 * x * x, x * r2**3,
                         y * r2, y * r2**2, r2 + 2 * y * y, xy, y * r2**3], axis=-1)
        matrices[..., 4:] = self.matrix[:2, :2] @ lens.reshape(*x.shape, 2, 5)
        return matrices

    def rays(self, pixels: ArrayLike) -> Array:
        """Undistort pixels (..., 2) to rays (..., 3) with z = 1."""
        normalised = self.normalise(pixels)
        rays = np.ones((*normalised.shape[:-1], 3))
        rays[..., :2] = normalised
        return rays


def _parts(pairs: ArrayLike) -> tuple[Array, Array]:
    both = np.asarray(pairs, dtype=np.float64)
    return both[..., 0], both[..., 1]


def _pairs(first: Array, second: Array) -> Array:
    both = np.empty((*first.shape, 2))
    both[..., 0], both[..., 1] = first, second
    return both


def _distort(x: Array, y: Array, distortion: Array) -> tuple[Array, Array]:
    """Apply the Brown-Conrady model: x_d and y_d."""
    _, _, p1, p2, _ = distortion
    r2, scale = _stretch(x, y, distortion)
    return x * scale + p2 * r2, y * scale + p1 * r2


def _linearise(x: Array, y: Array, distortion: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Give x_d and y_d, and how they change: dx_d/dx, dx_d/dy (which is dy_d/dx too), dy_d/dy."""
    k1, k2, p1, p2, k3 = distortion
    r2, scale = _stretch(x, y, distortion)
    bend = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3)))
    return (x * scale + p2 * r2, y * scale + p1 * r2,
            scale + (bend * x + 4.0 * p2) * x,
            bend * x * y + 2.0 * (p1 * x + p2 * y),
            scale + (bend * y + 4.0 * p1) * y)


def _stretch(x: Array, y: Array, distortion: Array) -> tuple[Array, Array]:
    """Give r² and what the model multiplies both x and y by."""
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    return r2, 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)) + 2.0 * (p1 * y + p2 * x)


@dataclass(frozen=True, eq=False)
class SensorModel:
    """The structured-light sensor: a camera and the light plane in the camera frame (mm).

    `camera_covariance` (9, 9) is that of fx, fy, cx, cy, k1, k2, p1, p2, k3, and
    `light_plane_covariance` (4, 4) that of the unit normal and the offset; None counts as exact.
    """

    camera: CameraModel
    light_plane: Plane
    camera_covariance: Array | None = None
    light_plane_covariance: Array | None = None

    @property
    def working_distance(self) -> float:
        """L in mm: z where the optic axis meets the light plane (paper, section 5.2)."""
        return -self.light_plane.offset / float(self.light_plane.normal[2])

    @property
    def triangulation_angle(self) -> float:
        """alpha in rad: the angle between optic axis and light plane (paper, section 5.1)."""
        return float(np.arcsin(abs(self.light_plane.normal[2])))
