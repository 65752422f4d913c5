"""What changed between two sets, in the terms of what is measured with them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.archive.sets import read_set
from cell.core.documents.calibration import HandEyeDocument, SensorDocument
from cell.core.documents.text import parse
from cell.core.geometry import Transform
from cell.core.optics import SensorModel
from cell.metrology.calibrate.set_change import Calibrated, changes, softened

MEANT = {"hand_eye": "the hand-eye", "light_plane": "the light plane", "focal": "the focal length"}


@dataclass(frozen=True)
class Change:
    """One figure of a comparison."""

    name: str
    meaning: str
    value: float
    unit: str


def compare_sets(folder: Path, first: str, second: str) -> tuple[Change, ...]:
    """Compare two sets of a cell.

    Raises:
        DocumentError: one is absent, damaged or wrong.
    """
    before, now = (_read(folder, name) for name in (first, second))
    return (*_compare(before.sensor, before.flange_from_camera, now.sensor, now.flange_from_camera),
            *_softened(before, now),
            *(Change(f"{name}_times", f"{MEANT[name]}, over what both uncertainties explain", times,
                     "times") for name, times in changes(before, now).items()))


def _compare(sensor: SensorModel, mount: Transform, other_sensor: SensorModel,
             other_mount: Transform) -> tuple[Change, ...]:
    _, turn = mount.distance(other_mount)
    focal = other_sensor.camera.matrix[0, 0] / sensor.camera.matrix[0, 0] - 1.0
    normals = float(np.clip(abs(sensor.light_plane.normal @ other_sensor.light_plane.normal), 0, 1))
    return (
        Change("point_mm", "a point of the stripe at the middle of the image, in the flange frame",
               _point_shift(sensor, mount, other_sensor, other_mount), "mm"),
        Change("mount_mm", "the camera's position on the flange",
               mount.distance(other_mount)[0], "mm"),
        Change("mount_deg", "its orientation", float(np.degrees(turn)), "degrees"),
        Change("focal_percent", "focal length", 100.0 * float(focal), "%"),
        Change("principal_px", "principal point", float(np.linalg.norm(
            other_sensor.camera.matrix[:2, 2] - sensor.camera.matrix[:2, 2])), "px"),
        Change("plane_deg", "the light plane's normal", float(np.degrees(np.arccos(normals))),
               "degrees"),
        Change("working_distance_mm", "working distance",
               other_sensor.working_distance - sensor.working_distance, "mm"),
    )


def _softened(before: Calibrated, now: Calibrated) -> tuple[Change, ...]:
    softer = softened(before, now)
    return () if softer is None else (
        Change("blur_percent", "softness of a sharp edge", 100.0 * softer, "%"),)


def _point_shift(sensor: SensorModel, mount: Transform, other: SensorModel,
                 other_mount: Transform) -> float:
    """Carry the same pixel to the flange by both sets."""
    middle = (np.array(sensor.camera.image_size) - 1.0) / 2.0
    points = [pose @ one.light_plane.meet(one.camera.rays(middle))
              for one, pose in ((sensor, mount), (other, other_mount))]
    return float(np.linalg.norm(points[0] - points[1]))


def _read(folder: Path, name: str) -> Calibrated:
    found = read_set(folder, name)
    sensor = parse(SensorDocument, found.texts["sensor"], found.sources["sensor"])
    hand_eye = parse(HandEyeDocument, found.texts["hand_eye"], found.sources["hand_eye"])
    covariance = None if hand_eye.covariance is None else np.array(hand_eye.covariance)
    return Calibrated(sensor.model, Transform(np.array(hand_eye.flange_from_camera)), covariance,
                      "kinematics" in found.texts)
