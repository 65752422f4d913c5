"""Decide whether to look at a hole again, and how: a ladder of tries with an end.

measured well enough                          accept
the tilt's share is too large, or the stripe
passes far from the centre                    recentre: bring the stripe onto the centre
the stripe misses, the border cuts            recentre, if the hole can be found
too dark, saturated                           other_exposure, of the image that is so
anything that may pass                        same_again, then other_exposure
what no second look changes, no time left,
no tries left                                 accept what there is, or give_up
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from cell.core.documents.calibration import Calibration
from cell.core.documents.job import Retry
from cell.core.documents.nominals import AXES, Hole
from cell.core.documents.result import Measured, NotMeasured, Outcome
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array, Plane
from cell.core.observation import Light, Observation
from cell.metrology.detect.hole import detect_hole
from cell.metrology.measure.body_frame import expect, reached
from cell.metrology.measure.exposure import advise_exposure

Action: TypeAlias = Literal["accept", "same_again", "other_exposure", "recentre", "give_up"]

FAR = 0.6  # of the radius: a stripe further from the centre sees too short a chord
NEAR = 0.1  # mm: a smaller shift is not worth a move
BY_THE_TILT = ("normal_prior", "form", "method")  # sources that vanish with a centred stripe
BESIDE = ("laser_misses_hole", "hole_cut_by_border", "stripe_too_short")
LASTING = ("slot", "radius_against_nominal", "tilt_against_nominal")
BY_EXPOSURE = ("too_dark", "saturated")


@dataclass(frozen=True, eq=False)
class NextLook:
    """What to do next. `camera_shift` (3,) mm in the camera frame for `recentre`; the exposures
    are multiplied by `exposure_factor`.
    """

    action: Action
    camera_shift: Array | None = None
    exposure_factor: Mapping[Light, float] = field(
        default_factory=lambda: {"ring": 1.0, "laser": 1.0})


def decide_next(observation: Observation, outcome: Outcome, hole: Hole, retry: Retry,
                calibration: Calibration, time_left: float) -> NextLook:
    """Decide what to do after an attempt.

    Args:
        observation: everything seen of the hole so far.
        outcome: what `measure_hole` made of it.
        hole: as the plan has it.
        retry: the job's limits.
        calibration: the calibration set and the body registration.
        time_left: seconds that may still be spent on further looks at this body.
    """
    tries = len({view.attempt for view in observation.views})
    over = tries >= retry.attempts or time_left <= 0.0
    if isinstance(outcome, Measured):
        shift = _towards_centre(outcome, calibration)
        newest = observation.views[outcome.reference].attempt == observation.views[-1].attempt
        if over or not newest or not _worth_a_move(outcome, shift, hole, retry):
            return NextLook("accept")
        return NextLook("recentre", shift)
    if over or outcome.reason in LASTING:
        return NextLook("give_up")
    return _try_again(observation, outcome, hole, retry, calibration)


def _towards_centre(outcome: Measured, calibration: Calibration) -> Array:
    """The smallest shift of the camera that brings the light plane onto the hole's centre."""
    plane = calibration.sensor.model.light_plane
    return np.asarray(plane.normal * plane.distance(outcome.located.centre))


def _worth_a_move(outcome: Measured, shift: Array, hole: Hole, retry: Retry) -> bool:
    distance = float(np.linalg.norm(shift))
    if not retry.recentre or not NEAR < distance <= retry.recentre_limit_mm:
        return False
    return distance > FAR * outcome.diameter / 2.0 or _over_budget(outcome, hole, retry)


def _over_budget(outcome: Measured, hole: Hole, retry: Retry) -> bool:
    """Whether the sources that centring removes take more of a tolerance than they may."""
    gained = np.sqrt(sum(np.square(outcome.budget[source]) for source in BY_THE_TILT
                         if source in outcome.budget))
    allowed = {axis: retry.budget_share * tolerance / 2.0
               for axis, tolerance in hole.tolerance.items()}
    return any(axis in hole.control and share > allowed.get(axis, np.inf)
               for axis, share in zip(AXES, np.broadcast_to(gained, 4), strict=True))


def _try_again(observation: Observation, outcome: NotMeasured, hole: Hole, retry: Retry,
               calibration: Calibration) -> NextLook:
    tries = len({view.attempt for view in observation.views})
    if outcome.reason in BESIDE and retry.recentre:
        shift = _towards_hole(observation, hole, calibration)
        if NEAR < float(np.linalg.norm(shift)) <= retry.recentre_limit_mm:
            return NextLook("recentre", shift)
    if outcome.reason in BY_EXPOSURE or tries > 1:
        return NextLook("other_exposure", exposure_factor=advise_exposure(observation))
    return NextLook("same_again")


def _towards_hole(observation: Observation, hole: Hole, calibration: Calibration) -> Array:
    """The shift that brings the hole onto the optic axis, where the light meets it.

    The hole is where the picture shows it, on the plan's plane; or else where the plan has it.
    """
    sensor = calibration.sensor.model
    ring = [view for view in observation.views if view.light == "ring"][-1]
    camera_from_body = calibration.body_from_camera(
        reached(ring, calibration.kinematics)).inverse
    camera_from_plan = camera_from_body @ observation.body_from_predicted
    centre = camera_from_plan @ hole.centre_on_seen_face
    with suppress(UnmeasurableError):
        rim = detect_hole(ring.image, sensor.camera, expect(hole, camera_from_plan, 0.0))
        plane = Plane.through(centre, camera_from_plan.turn(hole.normal))
        centre = plane.meet(sensor.camera.rays(np.array(rim.ellipse[:2])))
    return np.asarray(centre - [0.0, 0.0, sensor.working_distance])
