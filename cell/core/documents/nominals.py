"""The nominals: one hole a row, in mm and body coordinates, as the drawing or the CMM has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cell.core.geometry import Array

AXES = ("x", "y", "z", "d")
"""The controlled quantities: three body coordinates and the diameter."""


@dataclass(frozen=True, eq=False)
class Hole:
    """One hole as a plan knows it.

    `tolerance` maps each axis of `control` to its half width (mm). `centre` (3,) is the full
    nominal position, controlled or not, on the face that the coordinates lie on, with outward
    `normal` (3,); `thickness` mm of sheet; `side` says whether that face is the one the camera
    sees. `cmm` and `cmm_u` are what a CMM measured on the master body (not the drawing's nominal),
    by axis.
    """

    id: str
    centre: Array
    normal: Array
    diameter: float
    thickness: float
    side: Literal["camera", "back"]
    control: frozenset[str]
    tolerance: dict[str, float]
    importance: str = ""
    cmm: dict[str, float] | None = None
    cmm_u: float | None = None

    @property
    def nominal(self) -> dict[str, float]:
        """The nominal of each axis of `control` in mm."""
        values = dict(zip(AXES, (*map(float, self.centre), self.diameter), strict=True))
        return {axis: values[axis] for axis in AXES if axis in self.control}

    @property
    def radius(self) -> float:
        """The nominal radius in mm."""
        return self.diameter / 2.0

    @property
    def normal_to_camera(self) -> Array:
        """The unit normal (3,) of the seen face, pointing to the side where the camera stands."""
        return self.normal if self.side == "camera" else -self.normal

    @property
    def centre_on_seen_face(self) -> Array:
        """The nominal centre (3,) carried through the sheet to the face that the camera sees."""
        return self.centre if self.side == "camera" else self.centre - self.thickness * self.normal

    def to_nominal_face(self, centre_on_seen_face: Array) -> Array:
        """Carry a measured centre (3,) from the seen face to the face the nominal lies on."""
        shift = self.centre - self.centre_on_seen_face
        return np.asarray(centre_on_seen_face) + shift
