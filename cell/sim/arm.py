"""The true arm: where the flange really stands when the controller says that it stands there."""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Transform
from cell.core.kinematics import Arm, arm_for
from cell.sim.scene import ArmScene

STANDING_RAD = 2e-5  # less than this between two readings is standing still
LONG_AGO = -1e6      # s
SWAY_HZ = 11.0       # at which an arm of this size swings after a stop


class TrueArm:
    """An arm with residual kinematics, hysteresis, imperfect repeatability, sway and a warm-up.

    It follows the joints as the controller reports them: the way a joint came decides the side of
    its hysteresis, and every new standstill has an error of its own that stays while it stands.
    """

    def __init__(self, scene: ArmScene, seed: int) -> None:
        self.model = arm_for(scene.model)
        self.scene = scene
        self._chance = np.random.default_rng([seed, *b"arm"])
        self._true = _with_residuals(self.model, scene, self._chance)
        self._hysteresis = np.radians(scene.hysteresis_deg) * self._chance.standard_normal(6)
        self._came_from = np.ones(6)
        self._last: Array | None = None
        self._moved_at = LONG_AGO
        self._standstill = np.zeros(6)

    @property
    def warm(self) -> Arm:
        """The arm as it truly is, hysteresis and chance aside, once it is warm."""
        return self._true

    def follow(self, joints: Array, time: float) -> None:
        """Take note of the joints (6,) in rad that the controller reports at `time` s."""
        self._moved_at = min(self._moved_at, time)  # a controller that restarts counts from 0
        if self._last is None:
            self._last = joints.copy()
        change = joints - self._last
        turned = np.abs(change) > STANDING_RAD
        if turned.any():
            self._came_from[turned] = np.sign(change[turned])
            self._standstill = (np.radians(self.scene.repeatability_deg)
                                * self._chance.standard_normal(6))
            self._last, self._moved_at = joints.copy(), time

    def flange(self, reported: Transform, joints: Array, time: float) -> Transform:
        """Return the true base_from_flange for a reported one, `time` s after the cold start."""
        if self.scene.ideal:
            return reported
        turned = joints + self._hysteresis * self._came_from + self._standstill + self._sway(time)
        true = self._at(time).forward(turned)
        return reported @ self.model.forward(joints).inverse @ true

    def _sway(self, time: float) -> Array:
        """Return how far the joints still swing, the way they came."""
        since = time - self._moved_at
        swing = np.exp(-since / self.scene.sway_s) * np.cos(2.0 * np.pi * SWAY_HZ * since)
        return np.radians(self.scene.sway_deg) * float(swing) * self._came_from

    def _at(self, time: float) -> Arm:
        """Return the arm as warm as it is: links are shorter when cold."""
        shorter = self.scene.cold_mm * float(np.exp(-time / self.scene.warm_up_s))
        return self._true.with_residuals(a=(0.0, shorter, shorter, 0.0, 0.0, 0.0))  # a2, a3 < 0


def _with_residuals(arm: Arm, scene: ArmScene, chance: np.random.Generator) -> Arm:
    a, d = scene.length_mm * chance.standard_normal((2, 6))
    alpha, theta = np.radians(scene.angle_deg) * chance.standard_normal((2, 6))
    return arm.with_residuals(a=tuple(a), d=tuple(d), alpha=tuple(alpha), theta=tuple(theta))
