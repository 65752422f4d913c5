"""The emulated arm's own kinematics, in metres: independent of what the application computes with.

The forward part is written out in the vertical plane that joint 1 turns; the inverse is Newton's
method from the joints at hand, which is what a straight line needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Build:
    """One model: link lengths in m, joint speeds in degrees a second, payload, dashboard name."""

    name: str
    lengths: tuple[float, float, float, float, float, float]  # d1 a2 a3 d4 d5 d6
    joint_speeds_deg: tuple[float, float, float, float, float, float]
    payload_kg: float


BUILDS = {
    "ur3e": Build("UR3", (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
                  (180, 180, 180, 360, 360, 360), 3.0),
    "ur5e": Build("UR5", (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
                  (180, 180, 180, 180, 180, 180), 5.0),
    "ur10e": Build("UR10", (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
                   (120, 120, 180, 180, 180, 180), 12.5),
    "ur16e": Build("UR16", (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
                   (120, 120, 180, 180, 180, 180), 16.0),
    "ur20": Build("UR20", (0.2363, -0.8620, -0.7287, 0.201, 0.1593, 0.1543),
                  (120, 120, 150, 210, 210, 210), 20.0),
    "ur30": Build("UR30", (0.2363, -0.6370, -0.5037, 0.201, 0.1593, 0.1543),
                  (120, 120, 150, 210, 210, 210), 30.0),
}


class EmulatedArm:
    """The kinematics of one model: poses are 4x4 matrices or UR's (x, y, z, rx, ry, rz)."""

    def __init__(self, build: Build) -> None:
        self.build = build
        self.joint_speeds = np.radians(build.joint_speeds_deg)

    def flange(self, joints: Array) -> Array:
        """Return the flange in the base (4, 4)."""
        points, axes = self._skeleton(joints)
        down, ahead, turn = axes[4], axes[5], float(joints[5])
        across = np.cross(ahead, down)
        matrix = np.eye(4)
        matrix[:3, 0] = cos(turn) * across - sin(turn) * down
        matrix[:3, 1] = -sin(turn) * across - cos(turn) * down
        matrix[:3, 2] = ahead
        matrix[:3, 3] = points[6]
        return matrix

    def near(self, base_from_flange: Array, joints: Array) -> Array | None:
        """Solve for the joints that hold the flange there, next to given ones: None if none is."""
        guess = np.array(joints, dtype=np.float64)
        for _ in range(30):
            gap = _gap(self.flange(guess), base_from_flange)
            if np.abs(gap).max() < 1e-10:
                return guess
            step = np.linalg.lstsq(self._jacobian(guess), gap, rcond=1e-6)[0]
            guess = guess + step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        return None

    def denavit_hartenberg(self) -> tuple[tuple[float, ...], ...]:
        """Return the rows as a controller publishes them: theta, a, d, alpha."""
        d1, a2, a3, d4, d5, d6 = self.build.lengths
        right = np.pi / 2
        return ((0.0,) * 6, (0.0, a2, a3, 0.0, 0.0, 0.0), (d1, 0.0, 0.0, d4, d5, d6),
                (right, 0.0, 0.0, right, -right, 0.0))

    def _skeleton(self, joints: Array) -> tuple[list[Array], list[Array]]:
        """List the joints' origins, flange last (7), and their axes (6)."""
        d1, a2, a3, d4, d5, d6 = self.build.lengths
        q1, q2, q3, q4, q5, _ = (float(q) for q in joints)
        out, up = np.array([cos(q1), sin(q1), 0.0]), np.array([0.0, 0.0, 1.0])
        side = np.array([sin(q1), -cos(q1), 0.0])
        fore = q2 + q3 + q4
        shoulder = d1 * up
        elbow = shoulder + a2 * (cos(q2) * out + sin(q2) * up)
        hand = elbow + a3 * (cos(q2 + q3) * out + sin(q2 + q3) * up)
        down = sin(fore) * out - cos(fore) * up
        ahead = cos(q5) * side - sin(q5) * (cos(fore) * out + sin(fore) * up)
        bend = hand + d4 * side
        wrist = bend + d5 * down
        points = [np.zeros(3), shoulder, elbow, hand, bend, wrist, wrist + d6 * ahead]
        return points, [up, side, side, side, down, ahead]

    def _jacobian(self, joints: Array) -> Array:
        points, axes = self._skeleton(joints)
        turns = [np.concatenate([np.cross(axis, points[6] - point), axis])
                 for axis, point in zip(axes, points[:6], strict=True)]
        return np.array(turns).T


def matrix_of(pose: Array) -> Array:
    """Turn (x, y, z, rx, ry, rz) into a 4x4 matrix."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    matrix[:3, 3] = pose[:3]
    return matrix


def pose_of(matrix: Array) -> Array:
    """Turn a 4x4 matrix into (x, y, z, rx, ry, rz)."""
    return np.concatenate([matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_rotvec()])


def _gap(reached: Array, wanted: Array) -> Array:
    turn = Rotation.from_matrix(wanted[:3, :3] @ reached[:3, :3].T).as_rotvec()
    return np.concatenate([wanted[:3, 3] - reached[:3, 3], turn])
