"""From the camera to the base, as measuring goes: the arm, put right where its rows are known."""

from __future__ import annotations

from dataclasses import dataclass

from cell.core.documents.calibration import KinematicsDocument
from cell.core.geometry import Transform
from cell.core.ports import Joints
from cell.metrology.measure.arm_correction import correct_flange


@dataclass(frozen=True, eq=False)
class Chain:
    """Where the camera sits on the flange, and the arm's own rows as a set has them."""

    flange_from_camera: Transform
    kinematics: KinematicsDocument | None = None

    def base_from_camera(self, base_from_reported: Transform, joints: Joints) -> Transform:
        """Chain a flange pose as the controller reported it, with the joints read with it."""
        return correct_flange(base_from_reported, joints, self.kinematics) @ self.flange_from_camera
