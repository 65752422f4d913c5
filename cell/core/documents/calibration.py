"""What a cell knows of itself: sensor, hand-eye, body registration, and the bundle of the three."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from cell.core.documents.base import Document, Matrix3, Matrix4, Number, Vector4, Vector6
from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel, SensorModel

Pixels = Annotated[int, Field(ge=16, le=20_000)]
Covariance: TypeAlias = tuple[tuple[Number, ...], ...]


SLANT = (float(np.sin(np.radians(1.0))), float(np.sin(np.radians(80.0))))  # of alpha


class CameraDocument(Document):
    """A camera alone: image size (width, height) and matrix in px, distortion as OpenCV has it.

    `blur` is optional: how soft a sharp edge appears at the working distance, the standard
    deviation in px; lens, pixel and sampling together, as rims are measured and as the calibration
    finds it on a board. With it, a rim that is softer is known to be rounded or burred, and one
    that is not, to be sharp.
    """

    image_size: tuple[Pixels, Pixels]
    camera_matrix: Matrix3
    distortion: tuple[Number, Number, Number, Number, Number]
    blur: Annotated[Number, Field(gt=0.0, le=10.0)] | None = None

    @field_validator("camera_matrix")
    @classmethod
    def _is_a_camera(cls, rows: Matrix3) -> Matrix3:
        (fx, _, _), (below, fy, _), last = rows
        if not (fx > 0.0 and fy > 0.0 and below == 0.0 and last == (0.0, 0.0, 1.0)):
            raise ValueError("expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0")
        return rows

    @property
    def camera(self) -> CameraModel:
        """The camera as mathematics uses it."""
        return CameraModel(self.image_size, np.array(self.camera_matrix), np.array(self.distortion),
                           self.blur)


class SensorDocument(CameraDocument):
    """`sensor.yaml`: the camera and the light plane, in the camera frame, mm and px.

    Covariances are optional; without them the sensor counts as exact. `camera_covariance` is 9x9
    over fx, fy, cx, cy, k1, k2, p1, p2, k3; `light_plane_covariance` 4x4 over the plane normalised
    to a unit normal.
    """

    light_plane: Vector4
    camera_covariance: Covariance | None = None
    light_plane_covariance: Covariance | None = None
    serial: str | None = None

    @field_validator("light_plane")
    @classmethod
    def _is_met_by_the_optic_axis(cls, plane: Vector4) -> Vector4:
        *_, c, d = plane
        if c == 0.0 or not -d / c > 0.0:
            raise ValueError("expected a, b, c, d of a plane that the optic axis meets in front "
                             "of the camera: -d / c above 0")
        if not SLANT[0] < abs(c) / np.linalg.norm(plane[:3]) < SLANT[1]:
            raise ValueError("expected a, b, c, d of a plane at a slant to the optic axis, "
                             "between 1 and 80 degrees")
        return plane

    @field_validator("camera_covariance", "light_plane_covariance")
    @classmethod
    def _is_a_covariance(cls, rows: Covariance | None, info: ValidationInfo) -> Covariance | None:
        return rows and check_covariance(rows, 9 if info.field_name == "camera_covariance" else 4)

    @cached_property
    def model(self) -> SensorModel:
        """The sensor as mathematics uses it."""
        return SensorModel(
            self.camera,
            Plane.from_coefficients(self.light_plane),
            _array_or_none(self.camera_covariance),
            _array_or_none(self.light_plane_covariance),
        )


def check_covariance(rows: Covariance, size: int) -> Covariance:
    """Refuse with ValueError what is not size x size, symmetric, and without negative variance."""
    if len(rows) != size or any(len(row) != size for row in rows):
        raise ValueError(f"expected a covariance of {size} rows with {size} numbers")
    matrix = np.array(rows, dtype=np.float64)
    spread = np.sqrt(np.abs(np.diag(matrix)))
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0):
        raise ValueError("expected a covariance: it is symmetric")
    whitened = matrix / np.outer(spread, spread).clip(min=np.finfo(np.float64).tiny)
    if np.linalg.eigvalsh(whitened).min() < -1e-6:
        raise ValueError("expected a covariance: it has no negative variance in any direction")
    return rows


def _check_pose_covariance(rows: Covariance) -> Covariance:
    return check_covariance(rows, 6)


NotNegative = Annotated[Number, Field(ge=0)]
PoseCovariance = Annotated[tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6],
                           AfterValidator(_check_pose_covariance)]
"""6x6 over a small rotation (rad) and translation (mm), order rx ry rz tx ty tz."""


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
    covariance: PoseCovariance | None = None
    robot_repeatability_mm: NotNegative = 0.0
    robot_repeatability_deg: NotNegative = 0.0


class BodyDocument(Document):
    """`body/<job>.yaml`: where the body's axes lie in the robot's base, as the fixture holds it.

    `base_from_body` is as registered. `drift_correction` carries what was measured then to where
    the same is measured now; it is only ever set on request.
    """

    base_from_body: Matrix4
    drift_correction: Matrix4 | None = None
    calibration_set: str | None = None
    covariance: PoseCovariance | None = None
    datums: tuple[str, ...] = ()


class KinematicsDocument(Document):
    """`kinematics.yaml`: how the arm's Denavit-Hartenberg rows differ from those that its
    controller reckons with, as estimated from board views (mm, rad), to be put on the published
    rows. Used for measuring only, never sent to the controller.

    `remaining_mm` and `remaining_deg` are the standard uncertainties per axis of a flange pose so
    corrected; where given they stand for the hand-eye's `robot_repeatability_*`. Hand-eye and body
    registration of a set with such a document are found with corrected poses too.
    """

    model: str
    a: Vector6
    d: Vector6
    alpha: Vector6
    theta: Vector6
    remaining_mm: NotNegative | None = None
    remaining_deg: NotNegative | None = None

    @model_validator(mode="after")
    def _says_both_or_neither(self) -> Self:
        if (self.remaining_mm is None) != (self.remaining_deg is None):
            raise ValueError("expected `remaining_mm` and `remaining_deg`, or neither")
        return self

    @property
    def is_nominal(self) -> bool:
        """Whether it corrects nothing."""
        return not any((*self.a, *self.d, *self.alpha, *self.theta))


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
    kinematics: KinematicsDocument | None = None

    @cached_property
    def flange_from_camera(self) -> Transform:
        """The hand-eye transform."""
        return Transform(np.array(self.hand_eye.flange_from_camera))

    @cached_property
    def base_from_body(self) -> Transform:
        """The body registration, with the correction of drift where there is one."""
        registered = Transform(np.array(self.body.base_from_body))
        if self.body.drift_correction is None:
            return registered
        return Transform(np.array(self.body.drift_correction)) @ registered

    @property
    def flange_sigmas(self) -> tuple[float, float]:
        """Standard uncertainties of a reached flange pose per axis: mm, rad."""
        left = self.kinematics
        if left and left.remaining_mm is not None and left.remaining_deg is not None:
            return left.remaining_mm, float(np.radians(left.remaining_deg))
        hand_eye = self.hand_eye
        return hand_eye.robot_repeatability_mm, float(np.radians(hand_eye.robot_repeatability_deg))

    def body_from_camera(self, base_from_flange: Transform) -> Transform:
        """Chain the frames from the reached flange pose."""
        return self.base_from_body.inverse @ base_from_flange @ self.flange_from_camera


def _array_or_none(rows: Covariance | None) -> Array | None:
    return None if rows is None else np.array(rows, dtype=np.float64)
