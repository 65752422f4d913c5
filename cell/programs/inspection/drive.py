"""Driving between the stops: what was planned and checked is what is driven."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.errors import DeviceError
from cell.core.geometry import Transform
from cell.core.ports import Joints, Move, RobotState
from cell.metrology.plan.stop_pose import step_back
from cell.metrology.plan.stops import PlannedStop
from cell.metrology.plan.way import Leg, check_leg
from cell.programs.inspection.prepare import Prepared
from cell.programs.station import Station

NOWHERE = np.radians(0.05)  # a turn that is not worth a move


@dataclass(frozen=True, eq=False)
class Stand:
    """Joints in front of a hole, and those a little further back from where it is entered."""

    name: str
    joints: Joints
    approach: Joints


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A named place on the way; `slow` where the move that ends there is."""

    name: str
    joints: Joints
    slow: bool = False


class Driver:
    """Drives one station through stops; knows where the arm stands and how to leave from there."""

    def __init__(self, station: Station, prepared: Prepared) -> None:
        self._station, self._prepared = station, prepared
        self._here: Stand | None = None

    def go_home(self) -> RobotState:
        """Leave by the approach and drive home; also how a run begins, from wherever the arm is.

        Raises:
            DeviceError: the way home from where the arm stands is not free, or the move failed.
        """
        home = tuple(map(float, np.radians(self._station.document.home_deg)))
        return self._drive([*self._way_out(), Waypoint("home", home)], arrived=None)

    def go_to(self, stand: Stand, via: Sequence[Joints] = ()) -> RobotState:
        """Leave the present stand and enter the next by its approach."""
        between = [Waypoint(f"via {index + 1} of {stand.name}", joints)
                   for index, joints in enumerate(via)]
        return self._drive([*self._way_out(), *between,
                            Waypoint(f"approach of {stand.name}", stand.approach),
                            Waypoint(stand.name, stand.joints, slow=True)], arrived=stand)

    def stand_at(self, stop: PlannedStop, base_from_flange: Transform) -> Stand | None:
        """Find the stand for a pose near the planned stop; None where it cannot be entered safely.

        The tube round the planned stop is checked here, move by move, as `cell check` checks it.
        """
        arm, document = self._prepared.arm, self._station.document
        back = step_back(base_from_flange, self._prepared.papers.calibration, document.approach_mm)
        joints, approach = (arm.closest(base_from_flange, stop.joints),
                            arm.closest(back, stop.approach))
        if joints is None or approach is None:
            return None
        legs = [Leg("the planned approach", "the approach", (stop.approach, approach)),
                Leg("the approach", stop.hole.id, (approach, joints))]
        blocked = any(check_leg(leg, document.limits, arm).problems for leg in legs)
        return None if blocked else Stand(stop.hole.id, joints, approach)

    def _way_out(self) -> Iterator[Waypoint]:
        if self._here is not None:
            yield Waypoint(self._here.name, self._here.joints)
            yield Waypoint(f"approach of {self._here.name}", self._here.approach, slow=True)

    def _drive(self, way: Sequence[Waypoint], arrived: Stand | None) -> RobotState:
        state = self._station.robot.state()
        self._refuse_unless_free(state.joints, way[0])
        self._here = None  # until the arrival is verified, nothing is known
        moves, here = [], state.joints
        for point in way:
            if float(np.abs(np.subtract(point.joints, here)).max()) > NOWHERE:
                moves.append(self._move(point))
                here = point.joints
        reached = self._station.robot.move_to(moves) if moves else state
        self._here = arrived
        return reached

    def _move(self, point: Waypoint) -> Move:
        robot = self._station.document.robot
        speed = robot.approach_speed_rad_per_s if point.slow else robot.speed_rad_per_s
        return Move(point.joints, speed, robot.acceleration_rad_per_s2)

    def _refuse_unless_free(self, here: Joints, first: Waypoint) -> None:
        """Refuse to start from a place that no plan has checked, unless that way is free too."""
        leg = Leg("where the arm stands", first.name, (here, first.joints))
        if leg.turn <= NOWHERE:
            return
        problems = check_leg(leg, self._station.document.limits, self._prepared.arm).problems
        if problems:
            raise DeviceError(f"the way from where the arm stands to {first.name} is not free: "
                              f"{problems[0]}. Jog the arm home by hand.", device="robot")
