"""What a cell knows of itself: sensor, hand-eye, body registration, and the bundle of the three."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cell.core.documents.base import Document, Matrix3, Matrix4, Number, Vector4, Vector6
from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel, SensorModel


class SensorDocument(Document):
    """`sensor.yaml`: the camera and the light plane, in the camera frame, mm and px.

    Covariances are optional; without them the sensor counts as exact. `camera_covariance` is 9x9
    over fx, fy, cx, cy, k1, k2, p1, p2, k3; `light_plane_covariance` 4x4 over the plane normalised
    to a unit normal.
    """

    image_size: tuple[int, int]
    camera_matrix: Matrix3
    distortion: tuple[Number, Number, Number, Number, Number]
    light_plane: Vector4
    camera_covariance: tuple[tuple[Number, ...], ...] | None = None
    light_plane_covariance: tuple[tuple[Number, ...], ...] | None = None
    serial: str | None = None

    @cached_property
    def model(self) -> SensorModel:
        """The sensor as mathematics uses it."""
        return SensorModel(
            CameraModel(self.image_size, np.array(self.camera_matrix), np.array(self.distortion)),
            Plane.from_coefficients(self.light_plane),
            _array_or_none(self.camera_covariance),
            _array_or_none(self.light_plane_covariance),
        )


class RobotRecord(Document):
    """The robot as its controller described it when the hand-eye was calibrated."""

    model: str
    serial: str
    kinematics_checksum: str = ""
    payload_kg: Number = 0.0
    tcp_offset: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class HandEyeDocument(Document):
    """`hand_eye.yaml`: where the camera sits on the flange, and on which robot that was found.

    `covariance` 6x6 over a small rotation (rad) and translation (mm) of the camera in the flange
    frame, order rx ry rz tx ty tz. `robot_repeatability_mm` and `_deg` are the standard
    uncertainties of a reached flange pose per axis.
    """

    flange_from_camera: Matrix4
    robot: RobotRecord
    sensor_serial: str | None = None
    covariance: tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6] | None = None
    robot_repeatability_mm: Number = 0.0
    robot_repeatability_deg: Number = 0.0


class BodyDocument(Document):
    """`body/<job>.yaml`: where the body's axes lie in the robot's base, as the fixture holds it."""

    base_from_body: Matrix4
    calibration_set: str | None = None
    covariance: tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6] | None = None
    datums: tuple[str, ...] = ()


class ActiveDocument(Document):
    """`active.yaml`: which calibration set the cell measures with, since when and by whom."""

    set: str
    by: str = ""
    at: str = ""
    previous: str | None = None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Calibration:
    """All that a measurement needs to know of the cell: one set and the body registration."""

    set_id: str
    sensor: SensorDocument
    hand_eye: HandEyeDocument
    body: BodyDocument

    @cached_property
    def flange_from_camera(self) -> Transform:
        """The hand-eye transform."""
        return Transform(np.array(self.hand_eye.flange_from_camera))

    @cached_property
    def base_from_body(self) -> Transform:
        """The body registration."""
        return Transform(np.array(self.body.base_from_body))

    def body_from_camera(self, base_from_flange: Transform) -> Transform:
        """Chain the frames from the reached flange pose."""
        return self.base_from_body.inverse @ base_from_flange @ self.flange_from_camera


def _array_or_none(rows: tuple[tuple[float, ...], ...] | None) -> Array | None:
    return None if rows is None else np.array(rows, dtype=np.float64)

