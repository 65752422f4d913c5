"""One view of a hole: pose, exposure, pose."""

from __future__ import annotations

import time

from cell.core.observation import Image, Light, View
from cell.core.ports import CameraTimeoutError
from cell.programs.station import Station

TRIES = 3  # exposures for one view: the arm stands, so another costs only time


def take_view(station: Station, light: Light, exposure: float, attempt: int) -> View:
    """Expose once for `exposure` seconds under `light`, which is on, between two readings of the
    pose.

    A view during which the arm moved is taken again; if it goes on moving, the last view is
    returned as it is, and measuring refuses it.

    Raises:
        DeviceError: robot, lights or camera failed.
    """
    view = _expose(station, light, exposure, attempt)
    for _ in range(TRIES - 1):
        if _stood_still(station, view):
            break
        view = _expose(station, light, exposure, attempt)
    return view


def _expose(station: Station, light: Light, exposure: float, attempt: int) -> View:
    before = station.robot.state()
    moment = time.time()
    image = _snap(station, exposure)
    after = station.robot.state()
    return View(image, light, exposure, moment, before.base_from_flange, after.base_from_flange,
                before.joints, attempt)


def _snap(station: Station, exposure: float) -> Image:
    for _ in range(TRIES - 1):
        try:
            return station.camera.snap(exposure)
        except CameraTimeoutError:
            continue  # the camera has re-armed itself
    return station.camera.snap(exposure)


def _stood_still(station: Station, view: View) -> bool:
    moved, turned = view.base_from_flange_before.distance(view.base_from_flange_after)
    return moved <= station.document.still_mm and turned <= station.document.still_rad
