"""How the emulated arm moves: trapezoidal speed along a joint path or a straight line, and halts.

A motion is asked where it is `t` seconds after its start and answers joints and joint speeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from cell.sim.controller.arm import Array, EmulatedArm, matrix_of, pose_of


class UnreachableError(Exception):
    """Report that a straight line leaves what the arm can reach: the program ends with an error."""


class Motion(Protocol):
    """Anything that leads the joints for `duration` seconds."""

    @property
    def duration(self) -> float:
        """How long it takes, in s."""

    def at(self, time: float) -> tuple[Array, Array]:
        """Return joints (6,) and joint speeds (6,) `time` seconds after the start."""


@dataclass(frozen=True)
class Trapezoid:
    """A length covered from rest to rest with one speed and one acceleration."""

    length: float
    speed: float
    acceleration: float

    @property
    def peak(self) -> float:
        """The speed reached: less than asked for on a short way."""
        return float(min(self.speed, np.sqrt(self.length * self.acceleration)))

    @property
    def duration(self) -> float:
        """The time from rest to rest."""
        return self.length / self.peak + self.peak / self.acceleration if self.length else 0.0

    def at(self, time: float) -> tuple[float, float]:
        """Return the way gone and the speed after `time` seconds."""
        left = self.duration - time
        ramp = self.peak / self.acceleration if self.length else 0.0
        if time <= 0.0 or left <= 0.0:
            return (self.length if left <= 0.0 else 0.0), 0.0
        if time < ramp:
            return self.acceleration * time**2 / 2, self.acceleration * time
        if left < ramp:
            return self.length - self.acceleration * left**2 / 2, self.acceleration * left
        return self.peak * (time - ramp / 2), self.peak


class JointPath:
    """A move in joint space: every joint starts and ends with the one that turns most."""

    def __init__(self, arm: EmulatedArm, joints: Array, goal: Array, speed: float,
                 acceleration: float) -> None:
        turn = goal - joints
        lead = float(np.abs(turn).max())
        self._joints, self._goal = joints, goal
        self._share = turn / lead if lead else np.zeros(6)
        allowed = arm.joint_speeds / np.maximum(np.abs(self._share), 1e-9)
        self._way = Trapezoid(lead, min(speed, float(allowed.min())), acceleration)

    @property
    def duration(self) -> float:
        """How long it takes, in s."""
        return self._way.duration

    def at(self, time: float) -> tuple[Array, Array]:
        """Return joints and joint speeds `time` seconds after the start."""
        way, speed = self._way.at(time)
        if time >= self.duration:
            return self._goal, np.zeros(6)
        return self._joints + way * self._share, speed * self._share


class LinePath:
    """A move of the TCP along a straight line; `speed` m/s, `acceleration` m/s²."""

    def __init__(self, arm: EmulatedArm, joints: Array, wanted: tuple[Array, Array],
                 speed: float, acceleration: float) -> None:
        goal, flange_from_tcp = wanted
        base_from_tcp, base_from_goal = arm.flange(joints) @ flange_from_tcp, matrix_of(goal)
        self._arm, self._near = arm, joints
        self._tcp_from_flange = np.linalg.inv(flange_from_tcp)
        self._ends = base_from_tcp[:3, 3], base_from_goal[:3, 3]
        both = Rotation.from_matrix(np.stack([base_from_tcp[:3, :3], base_from_goal[:3, :3]]))
        self._turn = Slerp([0.0, 1.0], both)
        angle = float((both[0].inv() * both[1]).magnitude())
        length = float(np.linalg.norm(self._ends[1] - self._ends[0]))
        self._way = Trapezoid(max(length, 0.3 * angle), speed, acceleration)
        self._last = 0.0, joints
        self._joints_at(1.0)  # an end out of reach is refused before the start

    @property
    def duration(self) -> float:
        """How long it takes, in s."""
        return self._way.duration

    def at(self, time: float) -> tuple[Array, Array]:
        """Return joints and joint speeds `time` seconds after the start."""
        way, _ = self._way.at(time)
        joints = self._joints_at(way / self._way.length if self._way.length else 1.0)
        (then, before), self._last, self._near = self._last, (time, joints), joints
        moving = time > then and time < self.duration
        return joints, (joints - before) / (time - then) if moving else np.zeros(6)

    def _joints_at(self, share: float) -> Array:
        here, there = self._ends
        base_from_tcp = np.eye(4)
        base_from_tcp[:3, :3] = self._turn(share).as_matrix()
        base_from_tcp[:3, 3] = here + share * (there - here)
        joints = self._arm.near(base_from_tcp @ self._tcp_from_flange, self._near)
        if joints is None:
            raise UnreachableError(f"no joints for {np.round(pose_of(base_from_tcp), 4).tolist()}")
        return joints


class Halt:
    """Braking from joint speeds: all joints come to rest together."""

    def __init__(self, joints: Array, speeds: Array, deceleration: float) -> None:
        self._joints, self._speeds = joints, speeds
        self._duration = float(np.abs(speeds).max()) / deceleration

    @property
    def duration(self) -> float:
        """How long it takes, in s."""
        return self._duration

    def at(self, time: float) -> tuple[Array, Array]:
        """Return joints and joint speeds `time` seconds after the start."""
        spent = min(time, self._duration)
        left = 1.0 - spent / self._duration if self._duration else 0.0
        return self._joints + self._speeds * spent * (1.0 + left) / 2.0, self._speeds * left
