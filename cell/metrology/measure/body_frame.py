"""From the camera to the body: where a plan's hole is expected, and where a located one lies.

`body_from_base @ base_from_flange @ flange_from_camera`, from the flange as reached, which is as
reported, corrected by the arm's kinematics where the calibration set has them. Each of the
three is known with an uncertainty: a small turn about the origin of the frame that is placed, and a
shift of that origin (R' = exp(turn) R, t' = t + shift).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cell.core.documents.calibration import Calibration, KinematicsDocument
from cell.core.documents.nominals import Hole
from cell.core.geometry import Array, Transform
from cell.core.observation import View
from cell.metrology.features import Expected
from cell.metrology.locate.uncertainty import Budget
from cell.metrology.measure.arm_correction import correct_flange


def reached(view: View, kinematics: KinematicsDocument | None = None) -> Transform:
    """Average the flange poses before and after an exposure, put right by the arm's kinematics.

    Returns:
        base_from_flange; as the controller reports it where there are no `kinematics`.
    """
    before, after = view.base_from_flange_before, view.base_from_flange_after
    between = (before.inverse @ after).rotation_vector
    halfway = before @ Transform.from_parts(between / 2.0, np.zeros(3))
    reported = Transform.from_parts(halfway.rotation,
                                    (before.translation + after.translation) / 2.0)
    return correct_flange(reported, view.joints, kinematics)


def expect(hole: Hole, camera_from_plan: Transform, normal_sigma: float) -> Expected:
    """Carry a plan's hole into the camera frame; `camera_from_plan` includes what is predicted."""
    return Expected(centre=camera_from_plan @ hole.centre_on_seen_face,
                    normal=camera_from_plan.turn(hole.normal_to_camera), normal_sigma=normal_sigma,
                    radius=hole.radius, thickness=hole.thickness)


def body_budget(camera: Budget, centre_in_camera: Array, base_from_flange: Transform,
                calibration: Calibration) -> Budget:
    """Carry a budget to the body frame, for x, y, z and the diameter, and add what the way costs.

    Args:
        camera: covariances (4, 4) of x, y, z and the radius in the camera frame, by source.
        centre_in_camera: of the hole, (3,) mm.
        base_from_flange: as reached.
        calibration: with the uncertainties of hand-eye, robot and body registration.
    """
    turn = np.diag([0.0, 0.0, 0.0, 2.0])
    turn[:3, :3] = calibration.body_from_camera(base_from_flange).rotation
    budget = {source: turn @ share @ turn.T for source, share in camera.items()}
    return budget | _way_budget(centre_in_camera, base_from_flange, calibration)


def _way_budget(centre_in_camera: Array, base_from_flange: Transform,
                calibration: Calibration) -> Budget:
    base_from_body, hand_eye = calibration.base_from_body, calibration.hand_eye
    body_from_base = base_from_body.inverse.rotation
    centre_in_flange = calibration.flange_from_camera @ centre_in_camera
    arm = base_from_flange.turn(centre_in_flange)
    in_body = calibration.body_from_camera(base_from_flange) @ centre_in_camera
    millimetres, radians = calibration.flange_sigmas
    causes = {
        "hand_eye": (calibration.flange_from_camera.turn(centre_in_camera),
                     body_from_base @ base_from_flange.rotation, hand_eye.covariance),
        "robot": (arm, body_from_base, np.diag(np.square([radians] * 3 + [millimetres] * 3))),
        "registration": (base_from_body.turn(in_body), body_from_base, calibration.body.covariance),
    }
    return {source: _placed(lever, turn, covariance)
            for source, (lever, turn, covariance) in causes.items() if covariance is not None}


def _placed(lever: Array, turn: Array, covariance: ArrayLike) -> Array:
    """Let the frame be off by a small turn and a shift: a point at `lever` moves turn × lever."""
    x, y, z = lever
    crossed = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    moved = turn @ np.hstack([crossed, np.eye(3)])
    share = np.zeros((4, 4))
    share[:3, :3] = moved @ np.asarray(covariance) @ moved.T
    return share
