"""What changed against the set before, over what the uncertainties of both explain.

Something that was only measured again stays within its expanded uncertainty (k = 2, both sets
together); beyond it, something has happened: a crash, a new mounting, another lens setting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array, Transform
from cell.core.optics import SensorModel
from cell.metrology.calibrate.working_volume import VOLUME, volume_shift

EXPANDED = 2.0


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A set: the sensor with what its covariances say, and where it sits on the flange.

    `covariance` (6, 6) is of the mount, over a small turn (rad) and shift (mm) in the flange frame;
    `arm_known` tells whether the arm's own rows are in it: mounts with and without them differ.
    """

    sensor: SensorModel
    flange_from_camera: Transform
    covariance: Array | None
    arm_known: bool = False


def changes(before: Calibrated, now: Calibrated) -> dict[str, float]:
    """Compare two sets: 1 is as much as both expanded uncertainties explain.

    What cannot be compared is left out: a part that has no covariance in either set, and mounts of
    which only one was found with the arm's own rows.
    """
    found = {"hand_eye": _mount(before, now), "light_plane": _plane(before, now),
             "focal": _focal(before, now)}
    return {name: change for name, change in found.items() if change is not None}


def softened(before: Calibrated, now: Calibrated) -> float | None:
    """Say by how much of itself the softness of a sharp edge has grown; None where one set does not
    know it.
    """
    blur, other = before.sensor.camera.blur, now.sensor.camera.blur
    return None if blur is None or other is None else other / blur - 1.0


def _mount(before: Calibrated, now: Calibrated) -> float | None:
    one, other = before.flange_from_camera, now.flange_from_camera
    covariance = _sum(before.covariance, now.covariance)
    if covariance is None or before.arm_known != now.arm_known:
        return None
    distance = now.sensor.working_distance
    volume = VOLUME + np.array([0.0, 0.0, distance])
    moved = np.mean(np.sum((one @ volume - other @ volume) ** 2, axis=1))
    rows = volume_shift(other, distance)
    by_mount = np.einsum("nij,jk,nik->", rows, covariance, rows) / len(VOLUME)
    by_camera = np.trace(_by_camera(before.sensor, now.sensor))
    return float(np.sqrt(moved / (by_mount + by_camera)) / EXPANDED)


def _plane(before: Calibrated, now: Calibrated) -> float | None:
    """Hold the planes apart where the new one crosses the working volume."""
    one, other = before.sensor.light_plane, now.sensor.light_plane
    covariance = _sum(before.sensor.light_plane_covariance, now.sensor.light_plane_covariance)
    if covariance is None:
        return None
    points = VOLUME + np.array([0.0, 0.0, now.sensor.working_distance])
    points = points - np.outer(other.distance(points), other.normal)
    rows = np.column_stack([points, np.ones(len(points))])
    by_plane = np.mean(np.einsum("ni,ij,nj->n", rows, covariance, rows))
    by_camera = other.normal @ _by_camera(before.sensor, now.sensor) @ other.normal
    return float(np.sqrt(np.mean(one.distance(points) ** 2) / (by_plane + by_camera)) / EXPANDED)


def _by_camera(before: SensorModel, now: SensorModel) -> Array:
    """Form the covariance (3, 3) mm² of where a board seems to stand, by that of both cameras.

    With another focal length it seems to stand at another distance, with another principal point
    aside; light plane and mount were found with it, and go along.
    """
    covariance = _sum(before.camera_covariance, now.camera_covariance)
    if covariance is None:
        return np.zeros((3, 3))
    moved = np.zeros((3, 4))
    moved[2, 0], moved[0, 2], moved[1, 3] = 1.0, -1.0, -1.0
    moved *= now.working_distance / now.camera.matrix[0, 0]
    return np.asarray(moved @ covariance[:4, :4] @ moved.T)


def _focal(before: Calibrated, now: Calibrated) -> float | None:
    gap = now.sensor.camera.matrix[0, 0] - before.sensor.camera.matrix[0, 0]
    covariance = _sum(before.sensor.camera_covariance, now.sensor.camera_covariance)
    if covariance is None:
        return None
    return float(abs(gap) / (EXPANDED * np.sqrt(covariance[0, 0])))


def _sum(one: Array | None, other: Array | None) -> Array | None:
    if one is None or other is None:
        return one if other is None else other
    return one + other
