"""The sphere of known radius: a check by laser, camera, hand-eye and arm; nothing is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.documents.calibration_session import CalibrationPlan
from cell.core.documents.targets import SphereDocument
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array, Transform
from cell.core.observation import Image
from cell.core.optics import SensorModel
from cell.core.ports import Joints, Operator
from cell.metrology.calibrate.detect_sphere_stripe import detect_sphere_stripe
from cell.metrology.calibrate.gates import Checked, Gate, check_gates
from cell.metrology.calibrate.sphere import SphereProblem, SphereResult, solve_sphere
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.chain import Chain


@dataclass(frozen=True, eq=False)
class SphereLook:
    """The stripe on a sphere, pixels (n, 2), and where the flange stood, as it was reported."""

    pixels: Array
    base_from_flange: Transform
    joints: Joints


@dataclass(frozen=True, eq=False)
class SphereCheck:
    """What came of the looks; `result` is None where they were too few, and `gates` say so."""

    result: SphereResult | None
    gates: tuple[Checked, ...]


def choose_sphere(plan: CalibrationPlan, belief: Belief,
                  operator: Operator) -> SphereDocument | None:
    """Choose the sphere that checks what was solved; say so where there is none."""
    if plan.sphere_views and not belief.targets.spheres:
        operator.tell("No sphere is in targets.yaml: the way through the laser is checked on the "
                      "board alone.")
    return next(iter(belief.targets.spheres), None) if plan.sphere_views else None


def see_sphere(stripe: Image, base_from_flange: Transform, joints: Joints, sphere: SphereDocument,
               belief: Belief) -> SphereLook:
    """Detect the stripe on a sphere in a picture taken from a flange pose as it was reported.

    Raises:
        UnmeasurableError: no stripe where the sphere must be.
    """
    camera_from_base = belief.chain.base_from_camera(base_from_flange, joints).inverse
    pixels = detect_sphere_stripe(stripe, belief.sensor, camera_from_base @ np.array(sphere.centre),
                                  sphere.radius_mm)
    return SphereLook(pixels, base_from_flange, joints)


def check_sphere(looks: Sequence[SphereLook], sphere: SphereDocument, sensor: SensorModel,
                 chain: Chain, gates: dict[str, Gate]) -> SphereCheck:
    """Carry every stripe to the base as measuring does, and hold the sphere against its gates."""
    sections = tuple(
        chain.base_from_camera(look.base_from_flange, look.joints)
        @ sensor.light_plane.meet(sensor.camera.rays(look.pixels)) for look in looks)
    try:
        result = solve_sphere(SphereProblem(sections, sphere.radius_mm, np.array(sphere.centre)))
    except UnmeasurableError:
        return SphereCheck(None, check_gates({"poses": 0}, gates))
    figures = {"poses": len(looks), "spread_mm": result.spread, "rms_mm": result.rms,
               "radius_off_mm": abs(result.radius - sphere.radius_mm)}
    return SphereCheck(result, check_gates(figures, gates))
