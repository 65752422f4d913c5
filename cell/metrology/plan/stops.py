"""Plan the stops: where the flange stands before every hole, and whether the way there is free.

A pose is taught in joints, or computed: the camera looks along the seen face's normal and has the
hole where its optic axis meets the light plane (or at the job's stand-off). Joints come from one
branch of the inverse kinematics, that of the home pose: the nearest within the cell's limits to the
stop before. Every stop is approached, and left, along the optic axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.documents.base import Vector2
from cell.core.documents.calibration import Calibration
from cell.core.documents.job import JobDocument, Stop
from cell.core.documents.nominals import Hole
from cell.core.documents.station import Limits, StationDocument
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.core.kinematics import Arm
from cell.core.ports import Joints
from cell.metrology.judge.align import check_alignment
from cell.metrology.judge.datum import UndeterminedError
from cell.metrology.plan.stop_pose import compute_pose, find_sight_problem, step_back
from cell.metrology.plan.way import Leg, Passage, check_leg, find_limit_problems, join_legs

TURNS = 2.0 * np.pi * np.array([-1.0, 0.0, 1.0])
MOST = 5  # refusals named in one message


@dataclass(frozen=True, eq=False)
class PlannedStop:
    """One stop: `via` and `approach` are driven through on the way to `joints` (all in rad);
    `base_from_flange` is the wanted pose.
    """

    hole: Hole
    base_from_flange: Transform
    joints: Joints
    approach: Joints
    via: tuple[Joints, ...] = ()
    taught: bool = False


@dataclass(frozen=True, eq=False)
class Plan:
    """All stops, every move between them, from home and back, and what speaks against it."""

    stops: tuple[PlannedStop, ...]
    passages: tuple[Passage, ...]
    refusals: tuple[tuple[str, str], ...]  # (hole or `home`, reason)


def plan_stops(job: JobDocument, holes: Sequence[Hole], calibration: Calibration,
               station: StationDocument, arm: Arm) -> tuple[PlannedStop, ...]:
    """Plan the stops of a job in their order, and check the whole way.

    Raises:
        DocumentError: the datums do not hold the body; a stop is out of reach or limits, or would
            not see its hole; or the way to it is not free. Names the stops and the reasons.
    """
    try:
        check_alignment(job.alignment, holes)
    except UndeterminedError as loose:
        raise DocumentError(str(loose), source=f"job {job.name}", place="alignment") from None
    plan = draw_plan(job, holes, calibration, station, arm)
    if plan.refusals:
        (hole, reason), *others = plan.refusals
        more = "".join(f"; stop {name}: {what}" for name, what in others[:MOST - 1])
        more += f"; and {len(others) - MOST + 1} more" if len(others) >= MOST else ""
        raise DocumentError(reason + more, source=f"job {job.name}", place=f"stop {hole}")
    return plan.stops


def draw_plan(job: JobDocument, holes: Sequence[Hole], calibration: Calibration,
              station: StationDocument, arm: Arm) -> Plan:
    """Plan as far as it goes, and collect every refusal instead of raising the first."""
    draughtsman = _Draughtsman(job, calibration, station, arm)
    by_id = {hole.id: hole for hole in holes}
    stops: list[PlannedStop] = []
    refusals: list[tuple[str, str]] = []
    for stop in job.stops or tuple(Stop(hole=hole.id) for hole in holes):
        seed = stops[-1].joints if stops else draughtsman.home
        try:
            stops.append(draughtsman.plan_stop(stop, by_id[stop.hole], seed))
        except _RefusedError as refused:
            refusals.append((stop.hole, str(refused)))
    passages = tuple(check_leg(leg, station.limits, arm)
                     for leg in walk(stops, draughtsman.home))
    refusals += _obstructed(passages)
    return Plan(tuple(stops), passages, tuple(refusals))


def walk(stops: Sequence[PlannedStop], home: Joints) -> Iterator[Leg]:
    """Walk from home through all stops, in and out by their approach, and home again."""
    here = ("home", home)
    for stop in stops:
        name = stop.hole.id
        at_approach = (f"{name} approach", stop.approach)
        via = [(f"{name} via {index + 1}", joints) for index, joints in enumerate(stop.via)]
        yield from join_legs(name, [here, *via, at_approach])
        yield from join_legs(name, [at_approach, (name, stop.joints), at_approach], slow=True)
        here = at_approach
    yield from join_legs("home", [here, ("home", home)])


def _obstructed(passages: Sequence[Passage]) -> Iterator[tuple[str, str]]:
    """Say once a stop where its way is not free: what follows mostly repeats it."""
    told = set()
    for passage in passages:
        leg = passage.leg
        if passage.problems and leg.stop not in told:
            told.add(leg.stop)
            yield leg.stop, f"on the way from {leg.start} to {leg.end}: " \
                            + "; ".join(passage.problems)


class _RefusedError(Exception):
    """A stop that cannot be; `str()` is the reason."""


@dataclass(frozen=True, eq=False)
class _Draughtsman:
    """Draws single stops for one job on one cell."""

    job: JobDocument
    calibration: Calibration
    station: StationDocument
    arm: Arm

    @property
    def home(self) -> Joints:
        return _radians(self.station.home_deg)

    def plan_stop(self, stop: Stop, hole: Hole, seed: Joints) -> PlannedStop:
        """Find the joints of a stop and of its approach; `_RefusedError` where there are none."""
        if stop.joints_deg is not None:
            joints = _radians(stop.joints_deg)
            base_from_flange = self.arm.forward(joints)
        else:
            base_from_flange = compute_pose(stop, hole, self.calibration, self.job.stand_off_mm)
            joints = self._solve(base_from_flange, seed)
        problem = find_sight_problem(hole, base_from_flange, self.calibration)
        if problem:
            raise _RefusedError(problem)
        approach = self._solve(step_back(base_from_flange, self.calibration,
                                         self.station.approach_mm), joints)
        return PlannedStop(hole, base_from_flange, joints, approach,
                           tuple(_radians(via.joints_deg) for via in stop.via),
                           stop.joints_deg is not None)

    def _solve(self, base_from_flange: Transform, seed: Joints) -> Joints:
        """Find the joints nearest to `seed`, on home's branch and within the limits."""
        found = self.arm.inverse(base_from_flange)
        if not found:
            reach = float(np.linalg.norm(base_from_flange.translation))
            raise _RefusedError(f"out of reach: the flange would be {reach:.0f} mm from the base")
        limits, home = self.station.limits, _branch(self.arm, self.home)
        near = sorted((_unwound(joints, seed, limits) for joints in found
                       if _branch(self.arm, joints) == home),
                      key=lambda joints: float(np.abs(np.subtract(joints, seed)).max()))
        if not near:
            raise _RefusedError("in reach only with the shoulder, elbow or wrist on the other side "
                                "than at home")
        allowed = [joints for joints in near if not any(find_limit_problems(joints, limits))]
        if not allowed:
            raise _RefusedError("; ".join(find_limit_problems(near[0], limits)))
        return allowed[0]


def _branch(arm: Arm, joints: Joints) -> tuple[bool, bool, bool]:
    """Which of the eight branches: shoulder, elbow, wrist."""
    wrist = arm.frames(np.array(joints))[5, :3, 3]
    ahead = wrist[0] * np.cos(joints[0]) + wrist[1] * np.sin(joints[0])
    return bool(ahead > 0.0), bool(np.sin(joints[2]) > 0.0), bool(np.sin(joints[4]) > 0.0)


def _unwound(joints: Joints, seed: Joints, limits: Limits) -> Joints:
    return tuple(map(_unwound_joint, joints, seed, limits.joints_deg))


def _unwound_joint(angle: float, near: float, allowed: Vector2) -> float:
    """Choose a joint's whole turn: within the limits if it can be, and then nearest to `near`."""
    low, high = np.radians(allowed)
    return float(min(angle + TURNS, key=lambda q: (not low <= q <= high, abs(q - near))))


def _radians(degrees: Sequence[float]) -> Joints:
    return tuple(float(angle) for angle in np.radians(degrees))
