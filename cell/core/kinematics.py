"""Where the flange stands for given joints, and the joints for a wanted flange: UR arms.

An arm is six Denavit-Hartenberg rows in the standard convention, as Universal Robots publishes
them: link_from_next = Rz(q + theta) · Tz(d) · Tx(a) · Rx(alpha). A controller's calibration changes
these rows slightly; `with_residuals` puts that in. The closed form of the inverse holds for the
published rows alone and is polished by Newton's method where residuals are present.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array, Transform
from cell.core.ports import Joints

JOINT_LIMIT = 2.0 * np.pi  # of every UR joint, either way
SINGULAR_SINE = 1e-9       # below it joints 4 and 6 turn about one line
NEWTON_STEPS = 25

Row = tuple[float, float, float, float, float, float]
ZERO: Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
UR_ALPHA: Row = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)

PUBLISHED_MM = {  # d1, a2, a3, d4, d5, d6
    "ur3e": (151.85, -243.55, -213.2, 131.05, 85.35, 92.1),
    "ur5e": (162.5, -425.0, -392.2, 133.3, 99.7, 99.6),
    "ur10e": (180.7, -612.7, -571.55, 174.15, 119.85, 116.55),
    "ur16e": (180.7, -478.4, -360.0, 174.15, 119.85, 116.55),
    "ur20": (236.3, -862.0, -728.7, 201.0, 159.3, 154.3),
    "ur30": (236.3, -637.0, -503.7, 201.0, 159.3, 154.3),
}


class SingularityMargins(NamedTuple):
    """How far joints (..., 6) are from each singularity of a UR arm, in degrees, each (...).

    Wrist: joint 5 at 0 or 180. Elbow: joint 3 at 0 or 180. Shoulder: the crossing of axes 5 and 6
    above axis 1 as far as the arm's offset lets it; the margin is half the turn of joint 1 between
    its two branches.
    """

    wrist_deg: Array
    elbow_deg: Array
    shoulder_deg: Array

    @property
    def least_deg(self) -> Array:
        """The smallest of the three."""
        return np.minimum(np.minimum(self.wrist_deg, self.elbow_deg), self.shoulder_deg)


@dataclass(frozen=True)
class Arm:
    """Six Denavit-Hartenberg rows: `a` and `d` in mm, `alpha` and the offset `theta` in rad."""

    a: Row
    d: Row
    alpha: Row = UR_ALPHA
    theta: Row = ZERO
    published: Arm | None = None

    def with_residuals(self, *, a: Row = ZERO, d: Row = ZERO, alpha: Row = ZERO,
                       theta: Row = ZERO) -> Arm:
        """Add a calibration's residuals (mm, rad) to the rows."""
        return replace(self, a=_added(self.a, a), d=_added(self.d, d),
                       alpha=_added(self.alpha, alpha), theta=_added(self.theta, theta),
                       published=self.published or self)

    def link(self, index: int, turn: ArrayLike) -> Array:
        """Return link_from_next (..., 4, 4) of row `index` (0 to 5), turned by `turn` (...)."""
        return _about_z(np.asarray(turn, dtype=np.float64)) @ self._tails[index]

    def frames(self, joints: ArrayLike) -> Array:
        """Stack base_from_link for joints (..., 6): (..., 7, 4, 4), base first, flange last."""
        turns = np.asarray(joints, dtype=np.float64) + self.theta
        chain = [np.broadcast_to(np.eye(4), (*turns.shape[:-1], 4, 4))]
        for index in range(6):
            chain.append(chain[-1] @ self.link(index, turns[..., index]))
        return np.stack(chain, axis=-3)

    def flanges(self, joints: ArrayLike) -> Array:
        """Stack the matrices base_from_flange for joints (..., 6): (..., 4, 4)."""
        return self.frames(joints)[..., 6, :, :]

    def forward(self, joints: ArrayLike) -> Transform:
        """Return base_from_flange for joints (6,) in rad."""
        return Transform(self.flanges(joints))

    def inverse(self, base_from_flange: Transform) -> tuple[Joints, ...]:
        """Solve for all joints that put the flange there, within ±pi: none if out of reach.

        Up to eight: two shoulders, two wrists, two elbows. At a wrist singularity, where only the
        sum of joints 4 and 6 matters, joint 6 is 0. Residuals are polished in, branch by branch.
        """
        closed = _closed_form(self.published or self, base_from_flange.matrix)
        if self.published is None:
            return tuple(closed)
        polished = (self._polished(base_from_flange, joints) for joints in closed)
        return tuple(joints for joints in polished if joints is not None)

    def closest(self, base_from_flange: Transform, seed: ArrayLike) -> Joints | None:
        """Solve for the joints nearest to `seed` (6,), whole turns included: None if unreachable.

        Nearest is the least turn of the joint that turns most. Every joint is within ±2 pi.
        """
        start = np.asarray(seed, dtype=np.float64)
        found = [_unwrapped(joints, start) for joints in self.inverse(base_from_flange)]
        return min(found, key=lambda q: float(np.abs(np.subtract(q, start)).max()), default=None)

    def jacobian(self, joints: ArrayLike) -> Array:
        """Return (6, 6): the flange's velocity (mm/rad) over its turn (rad/rad), in the base."""
        frames = self.frames(joints)
        axes, origins = frames[:6, :3, 2], frames[:6, :3, 3]
        return np.vstack([np.cross(axes, frames[6, :3, 3] - origins).T, axes.T])

    def singularity_margins(self, joints: ArrayLike) -> SingularityMargins:
        """Measure how far joints (..., 6) are from the singularities."""
        turns = np.asarray(joints, dtype=np.float64)
        wrist, axis = self.frames(turns)[..., 5, :3, 3], turns[..., 0] + self.theta[0]
        radial = wrist[..., 0] * np.cos(axis) + wrist[..., 1] * np.sin(axis)
        sideways = wrist[..., 0] * np.sin(axis) - wrist[..., 1] * np.cos(axis)
        return SingularityMargins(_from_half_turn_deg(turns[..., 4]),
                                  _from_half_turn_deg(turns[..., 2]),
                                  np.degrees(np.arctan2(np.abs(radial), np.abs(sideways))))

    @cached_property
    def _tails(self) -> Array:
        """Tz(d) · Tx(a) · Rx(alpha) of each row: (6, 4, 4)."""
        return np.array([_tail(*row) for row in zip(self.a, self.d, self.alpha, strict=True)])

    def _polished(self, base_from_flange: Transform, joints: Joints) -> Joints | None:
        """Go on by Newton's method from joints that are nearly right."""
        guess = np.array(joints)
        for _ in range(NEWTON_STEPS):
            gap = _gap(self.forward(guess), base_from_flange)
            if np.abs(gap).max() < 1e-9:
                return tuple(float(angle) for angle in _wrapped(guess))
            guess = guess + np.linalg.lstsq(self.jacobian(guess), gap, rcond=1e-8)[0]
        return None


def arm_for(model: str) -> Arm:
    """Return the published arm of a model such as `ur10e`; ValueError for an unknown one."""
    if model not in PUBLISHED_MM:
        raise ValueError(f"unknown arm {model!r}: expected one of {', '.join(PUBLISHED_MM)}")
    d1, a2, a3, d4, d5, d6 = PUBLISHED_MM[model]
    return Arm(a=(0.0, a2, a3, 0.0, 0.0, 0.0), d=(d1, 0.0, 0.0, d4, d5, d6))


def _closed_form(arm: Arm, matrix: Array) -> Iterator[Joints]:
    """Walk the branches of the published rows: shoulder, then wrist, then elbow."""
    wrist = matrix[:3, 3] - arm.d[5] * matrix[:3, 2]
    reach = np.hypot(wrist[0], wrist[1])
    if reach < abs(arm.d[3]):
        return
    swing = np.arccos(arm.d[3] / reach)
    for shoulder, side in product((1, -1), (1, -1)):
        q1 = np.arctan2(wrist[1], wrist[0]) + shoulder * swing + np.pi / 2
        q5, q6 = _wrist(matrix, q1, side)
        yield from _elbows(arm, matrix, q1, q5, q6)


def _wrist(matrix: Array, q1: float, side: int) -> tuple[float, float]:
    """Solve joints 5 and 6 from axis 2 as the flange sees it: (s5 c6, -s5 s6, c5)."""
    along_x, along_y, along_z = matrix[:3, :3].T @ (np.sin(q1), -np.cos(q1), 0.0)
    sine = np.hypot(along_x, along_y)
    q5 = side * np.arctan2(sine, along_z)
    if sine < SINGULAR_SINE:
        return q5, 0.0
    return q5, np.arctan2(-side * along_y, side * along_x)


def _elbows(arm: Arm, matrix: Array, q1: float, q5: float, q6: float) -> Iterator[Joints]:
    """Solve the plane arm of joints 2, 3 and 4 between the shoulder and a known wrist."""
    shoulder_from_base = np.linalg.inv(arm.link(0, q1))
    flange_from_forearm = np.linalg.inv(arm.link(4, q5) @ arm.link(5, q6))
    plane = shoulder_from_base @ matrix @ flange_from_forearm
    x, y = plane[:2, 3] - arm.d[3] * plane[:2, 1]
    upper, lower = arm.a[1], arm.a[2]
    cosine = (x * x + y * y - upper**2 - lower**2) / (2.0 * upper * lower)
    if abs(cosine) > 1.0:
        return
    whole = np.arctan2(plane[1, 0], plane[0, 0])
    for q3 in (np.arccos(cosine), -np.arccos(cosine)):
        q2 = np.arctan2(y, x) - np.arctan2(lower * np.sin(q3), upper + lower * np.cos(q3))
        yield tuple(float(q) for q in _wrapped(np.array([q1, q2, q3, whole - q2 - q3, q5, q6])))


def _gap(reached: Transform, wanted: Transform) -> Array:
    """The small motion from reached to wanted: mm, then rad, in the base (6,)."""
    turn = Rotation.from_matrix(wanted.rotation @ reached.rotation.T).as_rotvec()
    return np.concatenate([wanted.translation - reached.translation, turn])


def _wrapped(angles: Array) -> Array:
    """Bring angles into (-pi, pi]."""
    return np.pi - (np.pi - angles) % (2.0 * np.pi)


def _unwrapped(joints: Joints, seed: Array) -> Joints:
    """Add the whole turns that come nearest to the seed and stay within the limits."""
    near = seed + _wrapped(np.asarray(joints) - seed)
    inside = near - 2.0 * np.pi * np.sign(near) * (np.abs(near) > JOINT_LIMIT)
    return tuple(float(angle) for angle in inside)


def _from_half_turn_deg(angle: Array) -> Array:
    """Measure how far an angle is from the nearest multiple of 180 degrees."""
    return np.degrees(np.abs(np.arcsin(np.sin(angle))))


def _about_z(angle: Array) -> Array:
    matrix = np.zeros((*angle.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 1, 1] = np.cos(angle)
    matrix[..., 1, 0] = np.sin(angle)
    matrix[..., 0, 1] = -np.sin(angle)
    matrix[..., 2, 2] = matrix[..., 3, 3] = 1.0
    return matrix


def _tail(a: float, d: float, alpha: float) -> Array:
    cosine, sine = np.cos(alpha), np.sin(alpha)
    return np.array([[1.0, 0.0, 0.0, a], [0.0, cosine, -sine, 0.0],
                     [0.0, sine, cosine, d], [0.0, 0.0, 0.0, 1.0]])


def _added(row: Row, residual: Row) -> Row:
    return tuple(x + y for x, y in zip(row, residual, strict=True))  # type: ignore[return-value]
