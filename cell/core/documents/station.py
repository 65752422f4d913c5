"""`cell.yaml`: the devices of one cell, how it moves, and where it must not go."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from cell.core.documents.base import Document, Number, Vector2, Vector3, Vector6

Positive = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, strict=True, allow_inf_nan=False)]
# Upper bounds find a wrong unit: degrees a second, milliseconds.
Speed = Annotated[Number, Field(gt=0, le=3.2)]
Acceleration = Annotated[Number, Field(gt=0, le=40)]
Exposure = Annotated[Number, Field(gt=0, le=2)]
Host = Annotated[str, Field(pattern=r"^[A-Za-z0-9._:-]+$")]  # a name, or an address in digits


def _ascending(pair: Vector2) -> Vector2:
    if not pair[0] < pair[1]:
        raise ValueError("expected the lower limit before the upper one")
    return pair


Range = Annotated[Vector2, AfterValidator(_ascending)]


class RobotSettings(Document):
    """The arm. `driver: sim` starts the embedded controller emulator; `driver: ur` connects to a
    controller at `address` (a UR robot, URSim, or `cell sim`).
    """

    driver: Literal["sim", "ur"]
    model: Literal["ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"]
    address: Host | None = None
    serial: str | None = None
    speed_rad_per_s: Speed = 1.0
    acceleration_rad_per_s2: Acceleration = 2.0
    approach_speed_rad_per_s: Speed = 0.3
    settle_s: NotNegative = 0.2
    arrival_mm: Positive = 0.1
    arrival_deg: Positive = 0.02
    digital_output_ring: Annotated[int, Field(ge=0, le=15)] = 0
    digital_output_laser: Annotated[int, Field(ge=0, le=15)] = 1
    light_rise_s: NotNegative = 0.02

    @model_validator(mode="after")
    def _can_be_wired(self) -> Self:
        if self.digital_output_ring == self.digital_output_laser:
            raise ValueError("ring light and laser need an output each; both have "
                             f"{self.digital_output_ring}")
        return self


class CameraSettings(Document):
    """The camera. `driver: sim` looks at the scene of `scene`; `driver: video` opens `source` (an
    index, a device or a stream address) through OpenCV. `stale_s` is how old an image of a video
    source may be when it arrives: its exposure, transfer and buffers; `timeout_s` how long it may
    keep waiting beyond that, while the laser burns (a simulated camera renders in that time).
    """

    driver: Literal["sim", "video"]
    source: Annotated[str, Field(pattern=r"\S")] | int | None = None
    scene: str | None = None
    exposure_ring_s: Exposure = 0.008
    exposure_laser_s: Exposure = 0.004
    timeout_s: Positive = 2.0
    stale_s: NotNegative = 0.3

    @model_validator(mode="after")
    def _can_be_found(self) -> Self:
        needed = "scene" if self.driver == "sim" else "source"
        if getattr(self, needed) is None:
            raise ValueError(f"a camera with `driver: {self.driver}` needs its `{needed}`")
        return self

    @field_validator("scene")
    @classmethod
    def _stays_in_the_folder(cls, scene: str | None) -> str | None:
        if scene is not None and (scene.startswith("/") or ".." in scene.split("/")):
            raise ValueError("expected a file in the cell's own folder")
        return scene


class Box(Document):
    """A box aligned with the base frame, between two corners in mm."""

    name: str
    min: Vector3
    max: Vector3

    @field_validator("max")
    @classmethod
    def _is_beyond(cls, far: Vector3, info: ValidationInfo) -> Vector3:
        if not all(low < high for low, high in zip(info.data.get("min", far), far, strict=True)):
            raise ValueError("expected every coordinate of `max` above that of `min`")
        return far


class Limits(Document):
    """Where the cell may go. Joint limits are narrower than the arm's (cables); lengths in mm, in
    the base frame. `sensor_points` are points of the sensor's hull in the flange frame, which stay
    inside `workspace` and outside every keep-out box.
    """

    joints_deg: tuple[Range, Range, Range, Range, Range, Range]
    workspace: Box
    keep_out: tuple[Box, ...] = ()
    sensor_points: tuple[Vector3, ...] = ()
    singularity_margin_deg: NotNegative = 5.0


class StationDocument(Document):
    """`cell.yaml` as a whole. `home_deg` are the joints where a run starts and ends; every stop is
    approached from `approach_mm` further back along the optic axis.
    """

    name: str
    robot: RobotSettings
    camera: CameraSettings
    limits: Limits
    home_deg: Vector6
    approach_mm: NotNegative = 20.0
    still_mm: Positive = 0.02
    still_deg: Positive = 0.01

    @field_validator("robot")
    @classmethod
    def _can_be_reached(cls, robot: RobotSettings) -> RobotSettings:
        if robot.driver == "ur" and robot.address is None:
            raise ValueError("a robot with `driver: ur` needs its `address`")
        return robot

    @field_validator("home_deg")
    @classmethod
    def _is_within_the_limits(cls, home: Vector6, info: ValidationInfo) -> Vector6:
        limits = info.data.get("limits")
        for joint, (angle, (low, high)) in enumerate(
                zip(home, limits.joints_deg if limits else (), strict=limits is not None)):
            if not low <= angle <= high:
                raise ValueError(f"joint {joint + 1} of home is at {angle:g}, outside of its "
                                 f"limits {low:g} to {high:g}")
        return home

    @property
    def still_rad(self) -> float:
        """How far the flange may turn during an exposure."""
        return math.radians(self.still_deg)

    @property
    def simulated(self) -> bool:
        """Whether robot and camera are both virtual."""
        return self.robot.driver == "sim" and self.camera.driver == "sim"

