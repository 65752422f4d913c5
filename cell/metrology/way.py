"""The way of the sensor: every joint move sampled, and held against limits and obstacles.

A joint move is straight in joint space, so it is checked there: sampled finely, the sensor's hull
carried along. The hull is the sensor's points and the lines between every two of them. The arm
itself is not checked, only the sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from cell.core.documents.station import Box, Limits, RobotSettings
from cell.core.geometry import Array
from cell.core.kinematics import Arm
from cell.core.ports import Joints

STEP = np.radians(0.5)  # between two samples, of the joint that turns most
HULL_STEP = 25.0  # mm between two points on a line of the hull


@dataclass(frozen=True)
class Leg:
    """One joint move, between two named places; `slow` at approach speed."""

    start: str
    end: str
    joints: tuple[Joints, Joints]
    slow: bool = False

    @property
    def turn(self) -> float:
        """How far the leading joint turns, in rad."""
        return float(np.abs(np.subtract(*self.joints)).max())

    def duration(self, robot: RobotSettings) -> float:
        """Predict the time in s: a trapezoid of speed of the leading joint."""
        speed = robot.approach_speed_rad_per_s if self.slow else robot.speed_rad_per_s
        ramp = speed**2 / robot.acceleration_rad_per_s2
        if self.turn < ramp:
            return 2.0 * float(np.sqrt(self.turn / robot.acceleration_rad_per_s2))
        return (self.turn + ramp) / speed


@dataclass(frozen=True)
class Passage:
    """What a leg was found to be: how near it comes, and what speaks against it.

    `clearance` mm to `obstacle`, the nearest keep-out box (infinite without one); `singularity_deg`
    is the least margin; `problems` are sentences, none where the leg may be driven.
    """

    leg: Leg
    clearance: float
    obstacle: str
    singularity_deg: float
    problems: tuple[str, ...]


def check_leg(leg: Leg, limits: Limits, arm: Arm) -> Passage:
    """Check one joint move along its whole path; joint limits at its end, where they bind."""
    path = _samples(*leg.joints)
    flanges = arm.flanges(path)
    hull = _hull(limits.sensor_points)
    points = hull @ np.swapaxes(flanges[:, :3, :3], 1, 2) + flanges[:, None, :3, 3]
    clearance, obstacle = _clearance(points, limits.keep_out)
    margin = float(arm.singularity_margins(path).least_deg.min())
    problems = [*find_limit_problems(leg.joints[1], limits), *_outside(points, limits.workspace)]
    if clearance <= 0.0:
        problems.append(f"the sensor enters the keep-out box {obstacle!r}")
    if margin < limits.singularity_margin_deg:
        problems.append(f"comes within {margin:.1f} degrees of a singularity; "
                        f"expected at least {limits.singularity_margin_deg:g}")
    return Passage(leg, clearance, obstacle, margin, tuple(problems))


def find_limit_problems(joints: Joints, limits: Limits) -> Iterator[str]:
    """Find the joints (6,) in rad that are outside the cell's limits."""
    for index, (angle, (low, high)) in enumerate(zip(np.degrees(joints), limits.joints_deg,
                                                     strict=True)):
        if not low <= angle <= high:
            yield (f"joint {index + 1} at {angle:.1f} degrees; allowed are {low:g} to {high:g}")


def _samples(start: Joints, end: Joints) -> Array:
    count = int(np.ceil(np.abs(np.subtract(start, end)).max() / STEP)) + 2
    return np.linspace(start, end, count)


def _hull(corners: Sequence[Sequence[float]]) -> Array:
    """Fill the lines between all points of the sensor (flange frame): (n, 3)."""
    points = np.array(corners or [(0.0, 0.0, 0.0)], dtype=np.float64)
    lines = [np.linspace(a, b, int(np.linalg.norm(a - b) / HULL_STEP) + 2)
             for a, b in combinations(points, 2)]
    return np.vstack([points, *lines])


def _clearance(points: Array, boxes: Sequence[Box]) -> tuple[float, str]:
    """Measure the distance to the nearest box: 0 inside of it."""
    distances = {box.name: float(np.linalg.norm(np.maximum(
        np.maximum(np.array(box.min) - points, points - np.array(box.max)), 0.0), axis=-1).min())
        for box in boxes}
    nearest = min(distances, key=distances.__getitem__, default="")
    return distances.get(nearest, np.inf), nearest


def _outside(points: Array, workspace: Box) -> Iterator[str]:
    for index, axis in enumerate("xyz"):
        low, high = float(points[..., index].min()), float(points[..., index].max())
        if low < workspace.min[index]:
            yield (f"the sensor leaves the workspace: {axis} {low:.0f} mm, allowed from "
                   f"{workspace.min[index]:g}")
        if high > workspace.max[index]:
            yield (f"the sensor leaves the workspace: {axis} {high:.0f} mm, allowed up to "
                   f"{workspace.max[index]:g}")


def join_legs(places: Sequence[tuple[str, Joints]], *, slow: bool = False) -> Iterator[Leg]:
    """Join named places, in order, by joint moves."""
    for (start, first), (end, second) in pairwise(places):
        yield Leg(start, end, (first, second), slow)
