"""`cell.yaml`: the devices of one cell, how it moves, and where it must not go."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from cell.core.documents.base import Document, Vector2, Vector3, Vector6

Positive = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, strict=True, allow_inf_nan=False)]


class RobotSettings(Document):
    """The arm. `driver: sim` starts the embedded controller emulator; `driver: ur` connects to a
    controller at `address` (a UR robot, URSim, or `cell sim`).
    """

    driver: Literal["sim", "ur"]
    model: Literal["ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"]
    address: str | None = None
    serial: str | None = None
    speed_rad_per_s: Positive = 1.0
    acceleration_rad_per_s2: Positive = 2.0
    approach_speed_rad_per_s: Positive = 0.3
    settle_s: NotNegative = 0.2
    arrival_mm: Positive = 0.1
    arrival_deg: Positive = 0.02
    digital_output_ring: Annotated[int, Field(ge=0, le=15)] = 0
    digital_output_laser: Annotated[int, Field(ge=0, le=15)] = 1
    light_rise_s: NotNegative = 0.02


class CameraSettings(Document):
    """The camera. `driver: sim` looks at the scene of `scene`; `driver: video` opens `source` (an
    index, a device or a stream address) through OpenCV. `stale_s` is how old an image of a video
    source may be when it arrives: its exposure, transfer and buffers.
    """

    driver: Literal["sim", "video"]
    source: str | int | None = None
    scene: str | None = None
    exposure_ring_s: Positive = 0.008
    exposure_laser_s: Positive = 0.004
    timeout_s: Positive = 2.0
    stale_s: NotNegative = 0.3


class Box(Document):
    """A box aligned with the base frame, between two corners in mm."""

    name: str
    min: Vector3
    max: Vector3


class Limits(Document):
    """Where the cell may go. Joint limits are narrower than the arm's (cables); lengths in mm, in
    the base frame. `sensor_points` are points of the sensor's hull in the flange frame, which stay
    inside `workspace` and outside every keep-out box.
    """

    joints_deg: tuple[Vector2, Vector2, Vector2, Vector2, Vector2, Vector2]
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

    @property
    def still_rad(self) -> float:
        """How far the flange may turn during an exposure."""
        return math.radians(self.still_deg)

    @property
    def simulated(self) -> bool:
        """Whether robot and camera are both virtual."""
        return self.robot.driver == "sim" and self.camera.driver == "sim"

