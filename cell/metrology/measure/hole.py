"""Measure a hole: from everything seen of it to numbers with their uncertainty, or to a refusal.

The only place where an observation becomes a number, live and in an audit alike.
"""

from __future__ import annotations

import numpy as np

from cell.core.documents.calibration import Calibration
from cell.core.documents.nominals import Hole
from cell.core.documents.result import Located, Measured, NotMeasured, Outcome
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Observation
from cell.metrology.locate.joint import locate_joint
from cell.metrology.locate.pair import Method
from cell.metrology.locate.two_step import locate_two_step
from cell.metrology.locate.uncertainty import shares, total
from cell.metrology.measure.body_frame import body_budget
from cell.metrology.measure.sightings import Sighting, see, stripes_of


def measure_hole(observation: Observation, hole: Hole, calibration: Calibration, method: Method,
                 normal_sigma: float) -> Outcome:
    """Measure one hole in the body frame, or say why not.

    The newest attempt that shows hole and stripe is the reference; the stripes of other views,
    taken from elsewhere, join in.

    Args:
        observation: all views of the hole, with the reached poses.
        hole: as the plan has it.
        calibration: the calibration set and the body registration.
        method: `joint`, or the paper's `two-step`.
        normal_sigma: standard deviation of the plan's normal per tangent axis, rad.
    """
    try:
        sightings = see(observation, hole, calibration, normal_sigma)
        located, two_step = _locate(sightings, calibration, method)
    except UnmeasurableError as refused:
        return NotMeasured(hole.id, refused.reason, refused.detail)
    return _in_body(located, two_step, sightings[0], hole, calibration)


def _locate(sightings: list[Sighting], calibration: Calibration,
            method: Method) -> tuple[Located, Located]:
    """Locate in the camera frame of the first sighting: what counts, and the plain two-step."""
    sensor, reference = calibration.sensor.model, sightings[0]
    two_step = locate_two_step(reference.rim, reference.stripe, sensor, reference.expected)
    if method == "two-step":
        return two_step, two_step
    shots = stripes_of(sightings, calibration)
    return locate_joint(reference.rim, shots, sensor, reference.expected), two_step


def _in_body(located: Located, two_step: Located, reference: Sighting, hole: Hole,
             calibration: Calibration) -> Measured:
    base_from_flange = reference.base_from_flange
    body_from_camera = calibration.body_from_camera(base_from_flange)
    budget = body_budget(located.sources, located.centre, base_from_flange, calibration)
    if hole.side == "back":
        budget["face"] = _through_the_sheet(hole, reference.expected.normal_sigma)
    normal = None
    if located.normal is not None:
        normal = body_from_camera.turn(located.normal) * (1.0 if hole.side == "camera" else -1.0)
    return Measured(hole.id, hole.to_nominal_face(body_from_camera @ located.centre),
                    2.0 * located.radius, total(budget), normal, located, two_step,
                    reference.index, shares(budget))


def _through_the_sheet(hole: Hole, normal_sigma: float) -> Array:
    """Let the way through the sheet lean as far as the normal is unknown."""
    share = np.zeros((4, 4))
    share[:3, :3] = (np.eye(3) - np.outer(hole.normal, hole.normal)) * \
        (hole.thickness * normal_sigma)**2
    return share
