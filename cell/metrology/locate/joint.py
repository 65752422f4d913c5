"""The joint estimate: one circle in space that explains rim, stripes and what the plan knows.

The two-step method looks at the chord's midpoint and the ellipse's centre, which a tilt displaces
by tenths of a millimetre. Here all points take part, a circle in space is projected exactly (so
that there is no eccentricity to correct), and the tilt comes from where it can be had: across the
stripe from the plan and a little from the rim, along the stripe from the stripe itself. Form
unknowns keep an oval punch from being read as a tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from cell.core.documents.result import Located
from cell.core.geometry import Array, Plane, Transform, cross
from cell.core.optics import SensorModel
from cell.metrology.features import Expected, Rim, Stripe
from cell.metrology.locate.conic import circle_centre_ray
from cell.metrology.locate.joint_problem import Prior, Problem
from cell.metrology.locate.joint_rows import CRESTS, Circle, Sight, StripeSight
from cell.metrology.locate.posterior import Posterior, solve_all
from cell.metrology.locate.trace import trace_circle
from cell.metrology.locate.uncertainty import FORM_SIGMA, joint_budget, one_sided, shares, total
from cell.metrology.reasons import refusal

RADIUS_SIGMA = 0.1  # mm: weak on a whole rim, decisive on an arc
UNKNOWN_RADIUS_SIGMA = 100.0  # mm
UNKNOWN_NORMAL_SIGMA = 0.1  # rad: a sensor is held square to the sheet, to some six degrees
WIDEST_NORMAL_SIGMA = 0.3  # rad: a sheet seen edge-on shows no hole
SQUARE = np.array([0.0, 0.0, -1.0])
MOST_OFF_RADIUS = 0.2  # of the nominal: what lies beyond is another hole
MOST_OFF_NORMAL = 5.0  # standard deviations of the plan's normal, and at least
LEAST_OFF_NORMAL = np.radians(2.0)

Shot: TypeAlias = tuple[Stripe, Transform]
"""A stripe, and `camera_from_stripe_camera`: where its camera stood, seen from the rim's."""


def locate_joint(rim: Rim, stripes: Sequence[Shot], sensor: SensorModel,
                 expected: Expected) -> Located:
    """Locate the hole in the camera frame of the rim's image from the rim and all stripes.

    Raises:
        UnmeasurableError: the points make no ellipse, or contradict the plan.
    """
    posterior = solve_circle(rim, stripes, sensor, expected)
    circle = posterior.circle
    _check_against_plan(circle, expected)
    budget = joint_budget(posterior, rim, sensor)
    return Located("joint", circle.centre, circle.radius, circle.normal, total(budget),
                   shares(budget), {**rim.quality, **stripes[0][0].quality},
                   trace_circle(circle, rim, stripes[0][0], sensor), budget)


def solve_circle(rim: Rim, stripes: Sequence[Shot], sensor: SensorModel,
                 expected: Expected) -> Posterior:
    """Solve for the circle; an `expected.normal_sigma` near zero holds the normal."""
    crossings = tuple(StripeSight.of(stripe, sensor, pose) for stripe, pose in stripes)
    return solve_seen(rim, Sight.of(rim, sensor.camera), crossings, expected)


def solve_seen(rim: Rim, sight: Sight, crossings: tuple[StripeSight, ...],
               expected: Expected) -> Posterior:
    """Solve for the circle from a rim and stripes that are undistorted already."""
    start = _start(sight, crossings, expected)
    return solve_all(Problem(sight, crossings, _prior(start, rim, expected)), start)


def normal_sigma(expected: Expected) -> float:
    """Say how well the normal is known beforehand, rad per tangent axis."""
    if expected.normal is None:
        return UNKNOWN_NORMAL_SIGMA
    return min(expected.normal_sigma, WIDEST_NORMAL_SIGMA)


def _start(rim: Sight, stripes: Sequence[StripeSight], expected: Expected) -> Circle:
    """Begin with the expected normal: the pole of its horizon, on the plane through the stripes."""
    on_sheet = np.mean([stripe.points.mean(axis=0) for stripe in stripes], axis=0)
    normal = SQUARE if expected.normal is None else np.asarray(expected.normal, dtype=np.float64)
    normal = -normal * np.sign(normal @ on_sheet) / np.linalg.norm(normal)
    plane = Plane.through(on_sheet, normal)
    centre = plane.meet(circle_centre_ray(rim.conic, normal))
    radius = float(np.linalg.norm(plane.meet(rim.rays) - centre, axis=1).mean())
    return Circle(centre, normal, _tangents(normal, stripes[0]), np.zeros(2), radius,
                  np.zeros(2 * len(CRESTS)), np.zeros(len(stripes)))


def _tangents(normal: Array, stripe: StripeSight) -> Array:
    """Choose the turns: the first about the stripe (which says nothing of it), then the other."""
    light = stripe.camera_from_stripe_camera.turn(stripe.light_plane.normal)
    first = light - normal * (light @ normal)
    first /= np.linalg.norm(first)
    return np.stack([first, cross(normal, first)])


def _prior(start: Circle, rim: Rim, expected: Expected) -> Prior:
    mm_per_px = start.radius / float(np.sqrt(rim.ellipse[2] * rim.ellipse[3]))
    form_sigma = float(np.hypot(FORM_SIGMA, one_sided(rim) * mm_per_px))
    radius = start.radius if expected.radius is None else expected.radius
    radius_sigma = UNKNOWN_RADIUS_SIGMA if expected.radius is None else RADIUS_SIGMA
    return Prior(np.zeros(2), np.full(2, normal_sigma(expected)), form_sigma, radius,
                 radius_sigma)


def _check_against_plan(circle: Circle, expected: Expected) -> None:
    if expected.radius and abs(circle.radius - expected.radius) > MOST_OFF_RADIUS * expected.radius:
        raise refusal("radius_against_nominal",
                      f"{circle.radius:.2f} mm where {expected.radius:.2f} mm is nominal")
    off = float(np.linalg.norm(circle.turn))
    limit = max(MOST_OFF_NORMAL * expected.normal_sigma, LEAST_OFF_NORMAL)
    if expected.normal is not None and off > limit:
        raise refusal("tilt_against_nominal", f"{np.degrees(off):.1f} degrees from the plan's")
