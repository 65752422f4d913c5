"""A scene: all that decides a pair of pictures."""

from dataclasses import dataclass

import numpy as np

from ray_traced.detector import Chip, Lens
from ray_traced.light import Fan, Lamps
from ray_traced.sensor import Sensor
from ray_traced.surface import Finish


@dataclass(frozen=True)
class SkinPlan:
    """A finish, and the marks on it by name: scratches, dirt, spatter."""

    finish: Finish
    marks: tuple = ()


@dataclass(frozen=True)
class Exposure:
    """How bright the two pictures are, in grey values before the chip's black level.

    `face` is the plate's face in the hole image, or `clipped` the part of it that is white there;
    `stripe` is the stripe's middle and `room` the plate's face in the stripe image.
    """

    face: float
    stripe: float
    room: float
    clipped: float = 0.0


@dataclass(frozen=True)
class Speckle:
    """Speckle of the laser: its grain in px, and how many patterns are averaged."""

    grain: float
    looks: int


@dataclass(frozen=True)
class Label:
    """What `truth.json` says besides the geometry."""

    difficulty: str
    tags: tuple
    material: str
    ambiguity: float = 0.0
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A plate, its lights and its camera; lengths in mm.

    `turn` (3, 3) has the plate's axes in the camera frame as columns, z into the metal; `sheets`
    stand in the plate's frame, from the camera on, and `plate` is the number of the one with the
    hole. Lights are given in the camera frame.
    """

    seed: int
    sensor: Sensor
    centre: np.ndarray
    turn: np.ndarray
    radius: float
    sheets: tuple
    plate: int
    ring: Lamps
    side: Lamps
    sky: float
    fan: Fan | None
    lens: Lens
    chip: Chip
    exposure: Exposure
    speckle: Speckle
    label: Label
    swapped: bool = False
