"""Where the flange really stands: the pose that a controller reports, put right by kinematics.

A controller reckons with its own rows, those of its factory calibration, which nobody else needs to
know: what an arm is off by differs between them and the published rows in the second order alone
(a millimetre of one times a milliradian of the other). So the error is taken at the recorded joints
on the published rows and put onto the pose as reported. A pose is never made from joints.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from cell.core.documents.calibration import KinematicsDocument
from cell.core.geometry import Transform
from cell.core.kinematics import arm_for


def correct_flange(base_from_reported: Transform, joints: ArrayLike,
                   kinematics: KinematicsDocument | None) -> Transform:
    """Return base_from_flange = base_from_reported @ published(q)^-1 @ estimated(q).

    Args:
        base_from_reported: the flange as the controller reports it.
        joints: recorded with that pose, (6,) rad.
        kinematics: the arm's residuals; None, or all zero, leaves the pose as it is, to the bit.

    Raises:
        ValueError: residuals of an unknown model.
    """
    if kinematics is None or kinematics.is_nominal:
        return base_from_reported
    published = arm_for(kinematics.model)
    estimated = published.with_residuals(a=kinematics.a, d=kinematics.d, alpha=kinematics.alpha,
                                         theta=kinematics.theta)
    return base_from_reported @ published.forward(joints).inverse @ estimated.forward(joints)
