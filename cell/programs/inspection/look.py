"""One look at a hole: both pictures from one place, with the pose read round each exposure."""

from __future__ import annotations

import time
from collections.abc import Mapping

from cell.core.observation import Image, Light, View
from cell.core.ports import CameraTimeoutError
from cell.programs.station import Station

TRIES = 3  # exposures for one look: the arm stands, so another costs only time


def look(station: Station, exposures: Mapping[Light, float], attempt: int) -> tuple[View, View]:
    """Let the arm settle under the ring light, and take the hole's and the stripe's picture.

    The pose is read before, between and after the exposures. If the arm moved meanwhile both
    pictures are taken again; if it goes on moving, the last ones are returned as they are, and
    measuring refuses them. The laser burns no longer than it is used.

    Args:
        station: the open devices; the arm has just arrived.
        exposures: exposure time by light, s.
        attempt: which look at this hole it is, from 0.

    Returns:
        The view under the ring light and the view under the laser.

    Raises:
        DeviceError: robot, lights or camera failed; the lights are off.
    """
    arrived = time.monotonic()
    try:
        pair = _take_both(station, exposures, attempt, arrived)
        for _ in range(TRIES - 1):
            if all(_stood_still(station, view) for view in pair):
                break
            pair = _take_both(station, exposures, attempt, arrived)
        return pair
    finally:
        station.lights.off()


def _take_both(station: Station, exposures: Mapping[Light, float], attempt: int,
               arrived: float) -> tuple[View, View]:
    """Take both pictures. The laser rises while the pose between them is read."""
    lit = _light_up(station, "ring")
    station.pause(station.document.robot.settle_s, since=arrived)
    _let_rise(station, lit)
    before = station.robot.state()
    hole, hole_time = snap(station, exposures["ring"])
    lit = _light_up(station, "laser")
    between = station.robot.state()
    _let_rise(station, lit)
    stripe, stripe_time = snap(station, exposures["laser"])
    after = station.robot.state()
    return (View(hole, "ring", exposures["ring"], hole_time, before.base_from_flange,
                 between.base_from_flange, before.joints, attempt),
            View(stripe, "laser", exposures["laser"], stripe_time, between.base_from_flange,
                 after.base_from_flange, between.joints, attempt))


def _light_up(station: Station, light: Light) -> float:
    """Switch a light on and return when it was seen to be switched."""
    station.lights.set(light)
    return time.monotonic()


def _let_rise(station: Station, lit: float) -> None:
    station.pause(station.document.robot.light_rise_s, since=lit)


def snap(station: Station, exposure: float) -> tuple[Image, float]:
    """Expose once and return the picture and the time at which it was asked for."""
    tries = TRIES
    while True:
        moment = time.time()
        try:
            return station.camera.snap(exposure), moment
        except CameraTimeoutError:  # the camera has re-armed itself
            tries -= 1
            if not tries:
                raise


def _stood_still(station: Station, view: View) -> bool:
    moved, turned = view.base_from_flange_before.distance(view.base_from_flange_after)
    return moved <= station.document.still_mm and turned <= station.document.still_rad
