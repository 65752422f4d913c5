"""What was detected of a hole: pairs of rim and stripe, and stripes seen from elsewhere."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from cell.core.documents.calibration import Calibration
from cell.core.documents.nominals import Hole
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Transform
from cell.core.observation import Observation, View
from cell.core.optics import SensorModel
from cell.metrology.detect.ellipse import project_circle
from cell.metrology.detect.pair import detect_pair
from cell.metrology.detect.stripe import detect_stripe
from cell.metrology.features import Expected, Rim, Stripe
from cell.metrology.locate.joint import Shot, solve_circle
from cell.metrology.locate.joint_rows import Circle
from cell.metrology.measure.body_frame import expect, reached
from cell.metrology.reasons import refusal

STILL_MM, STILL_RAD = 0.05, np.radians(0.02)  # an arm that stands is far quieter
NEARBY = 0.3  # of an arm's error is what two poses a few millimetres apart do not share
BESIDE = ("laser_misses_hole", "hole_cut_by_border")  # the stripe may lie on the sheet all the same
ON_SHEET = 1.0  # mm off its plane, which a wrong normal explains
ELSEWHERE = 0.5  # mm: pictures from one place share their speckle, so that one stripe is enough


@dataclass(frozen=True, eq=False)
class Sighting:
    """A pair of views of one attempt, and what was detected in it. `index` is the place of the ring
    view among the observation's views, `base_from_flange` where the arm stood then, and `others`
    are further laser views: the attempt's own, and those of attempts that missed the hole.
    """

    index: int
    base_from_flange: Transform
    laser: View
    others: tuple[View, ...]
    rim: Rim
    stripe: Stripe
    expected: Expected


def see(observation: Observation, hole: Hole, calibration: Calibration,
        normal_sigma: float) -> list[Sighting]:
    """Detect hole and stripe in every attempt; the newest that shows both comes first.

    Raises:
        UnmeasurableError: no attempt shows both; with the reason of the newest.
    """
    found: list[Sighting] = []
    beside: tuple[View, ...] = ()
    refused: UnmeasurableError | None = None
    for attempt in sorted({view.attempt for view in observation.views}, reverse=True):
        try:
            found.append(_see(observation, attempt, hole, calibration, normal_sigma))
        except UnmeasurableError as error:
            refused = refused or error
            beside += _lasers(observation, attempt) if error.reason in BESIDE else ()
    if not found:
        raise refused or refusal("no_hole", "there is no view")
    return [replace(found[0], others=found[0].others + beside), *found[1:]]


def _lasers(observation: Observation, attempt: int) -> tuple[View, ...]:
    return tuple(view for view in observation.views
                 if view.attempt == attempt and view.light == "laser")


def _see(observation: Observation, attempt: int, hole: Hole, calibration: Calibration,
         normal_sigma: float) -> Sighting:
    index, ring = _last(observation, attempt)
    base_from_flange = reached(ring, calibration.kinematics)
    lasers = sorted(_lasers(observation, attempt),
                    key=lambda view: ring.base_from_flange_after.distance(
                        view.base_from_flange_before))
    if not lasers:
        raise refusal("no_laser", "there is no view with the laser")
    _check_still(ring, lasers[0])
    camera_from_body = calibration.body_from_camera(base_from_flange).inverse
    expected = expect(hole, camera_from_body @ observation.body_from_predicted, normal_sigma)
    rim, stripe = detect_pair(ring.image, lasers[0].image, calibration.sensor.model, expected)
    return Sighting(index, base_from_flange, lasers[0], tuple(lasers[1:]), rim, stripe, expected)


def _last(observation: Observation, attempt: int) -> tuple[int, View]:
    rings = [(index, view) for index, view in enumerate(observation.views)
             if view.attempt == attempt and view.light == "ring"]
    if not rings:
        raise refusal("no_hole", "there is no view with the ring light")
    return rings[-1]


def _check_still(ring: View, laser: View) -> None:
    stood = ring.base_from_flange_before
    for pose in (ring.base_from_flange_after, laser.base_from_flange_before,
                 laser.base_from_flange_after):
        millimetres, radians = stood.distance(pose)
        if millimetres > STILL_MM or radians > STILL_RAD:
            raise refusal("arm_moved",
                          f"by {millimetres:.3f} mm, {np.degrees(radians):.3f} degrees")


def stripes_of(sightings: list[Sighting], calibration: Calibration) -> list[Shot]:
    """Gather the stripes, seen from the first sighting's camera: one from each place."""
    reference = sightings[0]
    shots = [(reference.stripe, Transform.identity())]
    for sighting in sightings:
        if sighting is not reference:
            pose = _camera_from(reference, sighting.laser, calibration)
            if _elsewhere(pose, shots):
                shots.append((_loosened(sighting.stripe, calibration), pose))
        shots += _strays(sighting, shots, calibration, reference)
    return shots


def _strays(sighting: Sighting, shots: list[Shot], calibration: Calibration,
            reference: Sighting) -> list[Shot]:
    """Detect the stripe in views that have no ring view of their own: the hole is known by now."""
    sensor = calibration.sensor.model
    found: list[Shot] = []
    for view in sighting.others:
        pose = _camera_from(reference, view, calibration)
        if _elsewhere(pose, [*shots, *found]):
            circle = solve_circle(reference.rim, shots[:1], sensor, reference.expected).circle
            there = pose.inverse
            ellipse = project_circle(sensor.camera, there @ circle.centre,
                                     there.turn(circle.normal), circle.radius)
            x, y = map(float, ellipse.centre)
            rim = replace(reference.rim, ellipse=(x, y, *ellipse.axes))
            with suppress(UnmeasurableError):  # a stripe that misses adds nothing
                stripe = detect_stripe(view.image, rim, sensor.camera, sensor.light_plane,
                                       reference.expected)
                if _on_sheet(stripe, pose, circle, sensor):
                    found.append((_loosened(stripe, calibration), pose))
    return found


def _on_sheet(stripe: Stripe, pose: Transform, circle: Circle, sensor: SensorModel) -> bool:
    """Tell whether a stripe lies on the sheet of the hole, and not on another behind it."""
    points = pose @ sensor.light_plane.meet(sensor.camera.rays(stripe.points))
    return bool(np.median(np.abs((points - circle.centre) @ circle.normal)) < ON_SHEET)


def _camera_from(reference: Sighting, laser: View, calibration: Calibration) -> Transform:
    """`camera_from_stripe_camera`, by the reached flange poses."""
    flange_from_camera = calibration.flange_from_camera
    moved = reference.base_from_flange.inverse @ reached(laser, calibration.kinematics)
    return flange_from_camera.inverse @ moved @ flange_from_camera


def _elsewhere(pose: Transform, shots: list[Shot]) -> bool:
    return all(pose.distance(other)[0] > ELSEWHERE for _, other in shots)


def _loosened(stripe: Stripe, calibration: Calibration) -> Stripe:
    """Trust a stripe from elsewhere no further than the arm: its way there adds to the bias."""
    sensor = calibration.sensor.model
    px_per_mm = sensor.camera.matrix[0, 0] * np.tan(sensor.triangulation_angle) \
        / sensor.working_distance
    way = NEARBY * calibration.flange_sigmas[0]
    return replace(stripe, bias=float(np.hypot(stripe.bias, way * px_per_mm)))
