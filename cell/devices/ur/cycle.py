"""From a cycle of the controller, in metres and TCP poses, to the state of the arm in our words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from cell.core.errors import DeviceError
from cell.core.geometry import Transform
from cell.core.kinematics import Arm
from cell.core.ports import RobotState

MM_PER_M = 1000.0
STILL = 3e-3                     # rad/s: the noise of real joints at rest is below it
MODEL_MM, MODEL_DEG = 20.0, 2.0  # a calibrated arm is nearer to its published kinematics


class CycleReader:
    """Turn cycles into states: flange poses, whatever the active TCP is."""

    def __init__(self, arm: Arm, tcp_offset: Sequence[float]) -> None:
        self._arm = arm
        self._tcp_from_flange = Transform.from_parts(tcp_offset[3:], tcp_offset[:3]).inverse

    def read(self, cycle: dict[str, Any]) -> RobotState:
        """Read a state; DeviceError if pose and joints cannot belong to this arm and TCP."""
        pose = in_mm(cycle["tcp_pose"])
        base_from_tcp = Transform.from_parts(pose[3:], pose[:3])
        state = RobotState(base_from_flange=base_from_tcp @ self._tcp_from_flange,
                           joints=tuple(cycle["joints"]), controller_time=cycle["time"],
                           still=is_still(cycle), temperatures=tuple(cycle["temperatures"]))
        self._check_model(state)
        return state

    def _check_model(self, state: RobotState) -> None:
        """Compare pose and joints: another model or another TCP would shift every measurement."""
        millimetres, radians = self._arm.forward(state.joints).distance(state.base_from_flange)
        if millimetres > MODEL_MM or math.degrees(radians) > MODEL_DEG:
            raise DeviceError(f"joints and pose do not belong together ({millimetres:.1f} mm "
                              "apart): another model of arm, or the TCP was changed",
                              device="robot")


def is_still(cycle: dict[str, Any]) -> bool:
    """Whether no joint moves."""
    return max(map(abs, cycle["speeds"])) < STILL


def in_mm(pose: Sequence[float]) -> tuple[float, ...]:
    """Turn a UR's (x, y, z, rx, ry, rz) from metres into mm; the rotation vector stays."""
    return *(length * MM_PER_M for length in pose[:3]), *pose[3:]
