"""The way of the sensor: every joint move sampled, and held against limits and obstacles.

A joint move is straight in joint space, so it is checked there: sampled finely, the sensor's hull
carried along. The hull is the convex body of the sensor's points, filled with a grid; what lies
between two samples is covered by the clearance that is asked for. The arm itself is not checked,
only the sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, pairwise

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from cell.core.documents.base import Vector3
from cell.core.documents.station import Box, Limits, RobotSettings
from cell.core.geometry import Array
from cell.core.kinematics import Arm
from cell.core.ports import Joints

STEP = np.radians(0.5)  # between two samples, of the joint that turns most
GRID = 20.0  # mm between two points of the hull
CLEARANCE = 25.0  # mm to every box: half a cell's diagonal (17), and half a step at 1.5 m (7)


@dataclass(frozen=True)
class Leg:
    """One joint move, between two named places; `slow` at approach speed. `stop` is the hole for
    whose sake it is driven.
    """

    start: str
    end: str
    joints: tuple[Joints, Joints]
    slow: bool = False
    stop: str = ""

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
    hull = _fill_hull(limits.sensor_points)
    points = hull @ np.swapaxes(flanges[:, :3, :3], 1, 2) + flanges[:, None, :3, 3]
    clearance, obstacle = _clearance(points, limits.keep_out)
    margin = float(arm.singularity_margins(path).least_deg.min())
    problems = [*find_limit_problems(leg.joints[1], limits), *_outside(points, limits.workspace)]
    if clearance < CLEARANCE:
        problems.append(f"the sensor comes within {clearance:.0f} mm of the keep-out box "
                        f"{obstacle!r}; expected at least {CLEARANCE:g}")
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


@lru_cache(maxsize=8)
def _fill_hull(corners: tuple[Vector3, ...]) -> Array:
    """Fill the convex hull of the sensor's points (flange frame): (n, 3)."""
    points = np.array(corners or [(0.0, 0.0, 0.0)], dtype=np.float64)
    lines = [np.linspace(a, b, int(np.linalg.norm(a - b) / GRID) + 2)
             for a, b in combinations(points, 2)]
    return np.vstack([points, *lines, _fill_inside(points)])


def _fill_inside(points: Array) -> Array:
    """A grid inside of the hull; empty where the points are flat or few."""
    try:
        faces = ConvexHull(points).equations
    except (QhullError, ValueError):
        return np.empty((0, 3))
    ranges = [np.arange(low, high, GRID) for low, high in zip(points.min(0), points.max(0),
                                                              strict=True)]
    grid = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 3)
    return grid[(grid @ faces[:, :3].T + faces[:, 3] <= 0.0).all(axis=1)]


def _clearance(points: Array, boxes: Sequence[Box]) -> tuple[float, str]:
    """Find the distance of points (samples, n, 3) to the nearest box, 0 inside, and its name.

    Boxes are taken in the order of a lower bound from the hull's ball, most not at all.
    """
    centres = points.mean(axis=1)
    radius = float(np.linalg.norm(points[0] - centres[0], axis=1).max())
    bounds = sorted(((_distance(centres, box) - radius, box) for box in boxes),
                    key=lambda bound: bound[0])
    least, nearest = np.inf, ""
    for bound, box in bounds:
        if bound >= least:
            break
        if (distance := _distance(points, box)) < least:
            least, nearest = distance, box.name
    return least, nearest


def _distance(points: Array, box: Box) -> float:
    low, high = np.array(box.min), np.array(box.max)
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return float(np.sqrt(np.einsum("...i,...i", outside, outside).min()))


def _outside(points: Array, workspace: Box) -> Iterator[str]:
    for index, axis in enumerate("xyz"):
        low, high = float(points[..., index].min()), float(points[..., index].max())
        if low < workspace.min[index]:
            yield (f"the sensor leaves the workspace: {axis} {low:.0f} mm, allowed from "
                   f"{workspace.min[index]:g}")
        if high > workspace.max[index]:
            yield (f"the sensor leaves the workspace: {axis} {high:.0f} mm, allowed up to "
                   f"{workspace.max[index]:g}")


def join_legs(stop: str, places: Sequence[tuple[str, Joints]], *,
              slow: bool = False) -> Iterator[Leg]:
    """Join named places, in order, by joint moves."""
    for (start, first), (end, second) in pairwise(places):
        yield Leg(start, end, (first, second), slow, stop)
