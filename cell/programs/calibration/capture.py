"""Taking one view: drive, stand still, one picture under the ring light and one of the stripe."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from cell.core.documents.base import as_rows, as_six
from cell.core.documents.calibration_session import ViewRecord
from cell.core.observation import View
from cell.core.ports import Joints, Move
from cell.programs.calibration.session import Session
from cell.programs.inspection.look import look, snap
from cell.programs.station import Station

SLOW = 0.5  # of the cell's speed: nobody is in a hurry


@dataclass(frozen=True, eq=False)
class Shots:
    """Two pictures from one place."""

    ring: View
    stripe: View
    temperatures: tuple[float, ...] = ()  # of the joints, C

    def moved(self, station: Station) -> bool:
        """Whether the flange stood elsewhere for the second picture."""
        shift, turn = self.ring.base_from_flange_before.distance(
            self.stripe.base_from_flange_after)
        return shift > station.document.still_mm or turn > station.document.still_rad


def drive(station: Station, path: Sequence[Joints]) -> None:
    """Drive through joints at half of the cell's speed.

    Raises:
        DeviceError: the robot failed or was stopped.
    """
    robot = station.document.robot
    station.robot.move_to([Move(joints, SLOW * robot.speed_rad_per_s,
                                robot.acceleration_rad_per_s2) for joints in path])


def shoot(station: Station) -> Shots:
    """Let the arm settle and take both pictures; the laser burns for one of them and no longer.

    Raises:
        DeviceError: robot, lights or camera failed; the lights are off.
    """
    camera = station.document.camera
    ring, stripe = look(station, {"ring": camera.exposure_ring_s,
                                  "laser": camera.exposure_laser_s}, attempt=0)
    return Shots(ring, stripe, station.robot.state().temperatures)


def shoot_ring(station: Station) -> View:
    """Take one picture under the ring light, which is on and has risen; the arm may be moving.

    Raises:
        DeviceError: robot or camera failed.
    """
    exposure, before = station.document.camera.exposure_ring_s, station.robot.state()
    image, moment = snap(station, exposure)
    return View(image, "ring", exposure, moment, before.base_from_flange,
                station.robot.state().base_from_flange, before.joints, 0)


def record(session: Session, number: int, shots: Shots, corners: int,
           status: str) -> ViewRecord:
    """Write a view to the disk: pictures first, then its line; earlier takes of it stay.

    Raises:
        DocumentError: the disk refuses.
    """
    take = session.takes(number)
    name = f"{number:04d}" + (f"-{take + 1}" if take else "")
    ring = session.write_image(f"{name}_board.png", shots.ring.image)
    stripe = session.write_image(f"{name}_stripe.png", shots.stripe.image)
    view = describe(session, number, shots).model_copy(update={
        "ring": ring, "stripe": stripe, "corners": corners, "status": status})
    session.append(view)
    return view


def describe(session: Session, number: int, shots: Shots) -> ViewRecord:
    """Say what a view is, without its pictures."""
    target = session.header.numbered[number]
    return ViewRecord(
        number=number, purpose=target.purpose, place=target.place,
        joints=as_six(shots.ring.joints),
        base_from_flange=as_rows(shots.ring.base_from_flange_before),
        base_from_flange_after=as_rows(shots.stripe.base_from_flange_after),
        time=shots.ring.time, ring="", stripe="", temperatures=shots.temperatures)


def record_skipped(session: Session, number: int, station: Station, status: str) -> None:
    """Write down that a view was left out before a picture of it was taken.

    Raises:
        DeviceError: the robot does not answer.
        DocumentError: the disk refuses.
    """
    target, state = session.header.numbered[number], station.robot.state()
    here = as_rows(state.base_from_flange)
    session.append(ViewRecord(
        number=number, purpose=target.purpose, place=target.place, joints=as_six(state.joints),
        base_from_flange=here, base_from_flange_after=here, time=time.time(), ring="", stripe="",
        status=status))
