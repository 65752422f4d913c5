"""The fault states: which failure leads to which, what happened and what a person does about it."""

from __future__ import annotations

import errno

from cell.core.errors import CellError, DeviceError, RecordingError
from cell.core.ports import Fault, RobotStoppedError

ADVICE: dict[Fault, str] = {
    "protective_stop": "The robot stopped to protect itself. Look what it touched; clear it on the "
                       "pendant; reset if the body has not moved, else abort.",
    "safeguard_stop": "The guard is open. Close it and acknowledge it at the panel, then reset.",
    "emergency_stop": "Emergency stop. Find out why, release the button, switch the robot on, then "
                      "abort the body or reset if it has not moved.",
    "local_mode": "The robot is in local mode. Set it to remote control at the pendant, then "
                  "reset.",
    "paused": "The robot's program is paused on the pendant. Stop or resume it there, then reset.",
    "robot_lost": "No connection to the robot. Check its power and network, then reset.",
    "robot_failed": "The robot could not do as told. Read the reason; where the way is not "
                    "free jog it home by hand; then reset.",
    "camera_lost": "No image from the camera. Check its cable and power, then reset.",
    "lights_lost": "The lights do not follow. Check the outputs and their fuse, then reset.",
    "laser_dark": "Several holes without a laser stripe: check that the laser burns and its window "
                  "is clean, then reset.",
    "disk_full": "The disk is full. Make room in the logs folder, then reset.",
    "recording_failed": "The recording could not be written. Check the disk, then reset.",
    "holes_refused": "Several holes in a row were not measured. Look at the last images: window, "
                     "lights, body in place? Then reset.",
    "datum_missing": "A datum hole was not measured; without it the body cannot be judged. Look at "
                     "its images, then reset.",
    "master_failed": "The master check failed: sensor, robot or master has moved. Find out which; "
                     "reset to check the master again.",
    "results_lost": "The results database could not be written. Check disk and database, then "
                    "reset.",
}

STOPPED: dict[str, Fault] = {
    "protective_stop": "protective_stop", "safeguard_stop": "safeguard_stop",
    "emergency_stop": "emergency_stop", "local_mode": "local_mode", "paused": "paused"}
DEVICES: dict[str, Fault] = {"camera": "camera_lost", "lights": "lights_lost"}


class HolesRefusedError(DeviceError):
    """Report that the holes not measured on a body are a fault of the cell, and which."""

    def __init__(self, message: str, fault: Fault) -> None:
        self.fault = fault
        super().__init__(message, device="sensor")


def fault_of(error: CellError) -> Fault:
    """Name the state that a failure leads to."""
    if isinstance(error, HolesRefusedError):
        return error.fault
    if isinstance(error, RobotStoppedError):
        return STOPPED.get(error.state, "robot_lost")
    if isinstance(error, DeviceError):
        named = [fault for device, fault in DEVICES.items() if device in (error.device or "")]
        return named[0] if named else "robot_failed"
    if isinstance(error, RecordingError):
        return "disk_full" if _out_of_space(error) else "recording_failed"
    return "results_lost"


def _out_of_space(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False
