"""The equations of the joint estimate: what each seen point says of the circle, differentiated.

Every residual is a distance in the image in px, positive along `toward` (n, 2): so noise in px,
wrong intrinsics and a shifted stripe all enter in the same way. Unknowns, in this order:

| columns | unknown | unit |
|---|---|---|
| 0-2 | centre of the circle, camera frame | mm |
| 3-4 | turn of its normal along `Circle.tangents` | rad |
| 5 | radius | mm |
| 6-11 | form: what cos and sin of 2t, 3t and 4t add to the radius | mm |
| 12... | shift that all points of one stripe share | px |

The form keeps an oval punch from being read as a tilt, and waves of three and four crests from
being read as the perspective of one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.features import Rim, Stripe
from cell.metrology.locate.conic import fit_conic

SMALLEST_BIAS = 1e-4  # px: a prior needs a width
CRESTS = np.array([2, 3, 4])  # of the waves round a rim that its form may have
CENTRE, NORMAL, RADIUS, FORM, SHIFTS = slice(0, 3), slice(3, 5), 5, slice(6, 12), 12


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle in the camera frame, nearly round, and the shift of each stripe that crosses it.

    The normal is that of `nominal_normal`, turned by `turn` (2,) along `tangents` (2, 3).
    """

    centre: Array
    nominal_normal: Array
    tangents: Array
    turn: Array
    radius: float
    form: Array
    shifts: Array

    @cached_property
    def normal(self) -> Array:
        """The unit normal (3,)."""
        turned = self.nominal_normal + self.turn @ self.tangents
        return np.asarray(turned / np.linalg.norm(turned))

    @cached_property
    def normal_by_turn(self) -> Array:
        """The derivative (3, 2) of the unit normal by the two turns."""
        length = np.linalg.norm(self.nominal_normal + self.turn @ self.tangents)
        return (np.eye(3) - np.outer(self.normal, self.normal)) @ self.tangents.T / length

    def moved(self, step: Array) -> Circle:
        """Add a step in the order of the unknowns."""
        return replace(self, centre=self.centre + step[CENTRE], turn=self.turn + step[NORMAL],
                       radius=self.radius + float(step[RADIUS]), form=self.form + step[FORM],
                       shifts=self.shifts + step[SHIFTS:])

    def step_to(self, other: Circle) -> Array:
        """Subtract from another circle of the same tangents, in the order of the unknowns."""
        return np.concatenate([other.centre - self.centre, other.turn - self.turn,
                               [other.radius - self.radius], other.form - self.form,
                               other.shifts - self.shifts])


@dataclass(frozen=True, eq=False)
class Sight:
    """Points of one image, ready to be asked again and again: rays (n, 3) and how a pixel moves
    them (n, 2, 2), `sigma` px of one point, `correlation` points that share one error.
    """

    rays: Array
    normalised_by_pixel: Array
    sigma: float
    correlation: float

    @classmethod
    def of(cls, features: Rim | Stripe, camera: CameraModel) -> Sight:
        """Undistort the points of a rim or of a stripe."""
        rays = camera.rays(features.points)
        return cls(rays, camera.normalised_by_pixel(rays[:, :2]), features.sigma,
                   max(1.0, features.correlation))

    @cached_property
    def conic(self) -> Array:
        """The conic (3, 3) through the points, in normalised coordinates."""
        return fit_conic(self.rays[:, :2])

    def pixel_gradient(self, by_ray: Array) -> tuple[Array, Array]:
        """Turn derivatives (n, 3) by the ray into mm per px (n,) and unit directions (n, 2)."""
        gradient = np.einsum("ni,nij->nj", by_ray[:, :2], self.normalised_by_pixel)
        scale = np.hypot(gradient[:, 0], gradient[:, 1])
        return scale, gradient / scale[:, None]

    def moved_along(self, toward: Array, distance: Array) -> Array:
        """Move the points in the image (px) and return their rays (n, 3)."""
        moved = self.rays.copy()
        moved[:, :2] += np.einsum("nij,nj,n->ni", self.normalised_by_pixel, toward, distance)
        return moved


@dataclass(frozen=True, eq=False)
class StripeSight:
    """A stripe's points, where its camera stood, and the light plane in that camera's frame."""

    sight: Sight
    camera_from_stripe_camera: Transform
    light_plane: Plane
    shift_sigma: float

    @classmethod
    def of(cls, stripe: Stripe, sensor: SensorModel, pose: Transform) -> StripeSight:
        """Undistort the points of a stripe."""
        return cls(Sight.of(stripe, sensor.camera), pose, sensor.light_plane,
                   max(stripe.bias, SMALLEST_BIAS))

    @cached_property
    def points(self) -> Array:
        """The points on the light plane (n, 3), in the frame of the rim's camera."""
        return self.camera_from_stripe_camera @ self.light_plane.meet(self.sight.rays)


@dataclass(frozen=True, eq=False)
class Rows:
    """Residuals (n,) in px, their Jacobian (n, 12 + stripes), the direction (n, 2) in the image
    along which each is measured, at which `normalised` coordinates (n, 2); `by_plane` (n, 4)
    differentiates by the light plane's normal and offset.
    """

    residual: Array
    jacobian: Array
    toward: Array
    normalised: Array
    by_plane: Array


def rim_rows(circle: Circle, sight: Sight) -> Rows:
    """Compare the rim: rays meet the circle's plane, and lie at the radius from its centre.

    Derivatives are taken on the circle, not at the noisy point: else noise would pull the tilt.
    """
    n = circle.normal
    reach = float(n @ circle.centre) / (sight.rays @ n)
    spokes = sight.rays * reach[:, None] - circle.centre
    length = np.linalg.norm(spokes, axis=1)
    outward = spokes / length[:, None]
    waves = _waves(*circle.tangents @ outward.T)
    wanted = circle.radius + waves @ circle.form
    on_circle = circle.centre + outward * wanted[:, None]
    along = np.einsum("ni,ni->n", outward, on_circle) / (on_circle @ n)
    scale, toward = sight.pixel_gradient((outward - along[:, None] * n) * on_circle[:, 2:])
    jacobian = np.zeros((len(spokes), SHIFTS + len(circle.shifts)))
    jacobian[:, CENTRE] = along[:, None] * n - outward
    jacobian[:, NORMAL] = -((along * wanted)[:, None] * outward) @ circle.normal_by_turn
    jacobian[:, RADIUS] = -1.0
    jacobian[:, FORM] = -waves
    return Rows((length - wanted) / scale, jacobian / scale[:, None], toward, sight.rays[:, :2],
                np.zeros((len(spokes), 4)))


def _waves(cosine: Array, sine: Array) -> Array:
    """Give cos and sin of 2t, 3t and 4t (n, 6) from those of t (n,)."""
    turned = (cosine + 1j * sine)[:, None] ** CRESTS
    return np.asarray(np.concatenate([turned.real, turned.imag], axis=1))


def stripe_rows(circle: Circle, stripe: StripeSight, index: int) -> Rows:
    """Compare a stripe: its points lie on the image of the line where light meets the sheet.

    Derivatives are taken at the foot of each point on that line: else noise would pull the tilt.
    The sheet is n·X = d in the frame of the stripe's camera, the light plane m·X + o = 0: a ray u
    to the line has (o n + d m)·u = 0.
    """
    sight, pose, plane = stripe.sight, stripe.camera_from_stripe_camera, stripe.light_plane
    n, m = pose.rotation.T @ circle.normal, plane.normal
    arm = circle.centre - pose.translation
    d = float(circle.normal @ arm)
    line = plane.offset * n + d * m
    scale, toward = sight.pixel_gradient(np.broadcast_to(line, sight.rays.shape))
    off = sight.rays @ line / scale
    foot = sight.moved_along(toward, -off)
    light = foot @ m
    jacobian = np.zeros((len(foot), SHIFTS + len(circle.shifts)))
    jacobian[:, CENTRE] = np.outer(light, circle.normal)
    by_normal = plane.offset * foot @ pose.rotation.T + np.outer(light, arm)
    jacobian[:, NORMAL] = by_normal @ circle.normal_by_turn
    jacobian /= scale[:, None]
    jacobian[:, SHIFTS + index] = -1.0
    by_plane = np.column_stack([d * foot, foot @ n]) / scale[:, None]
    return Rows(off - circle.shifts[index], jacobian, toward, foot[:, :2], by_plane)
