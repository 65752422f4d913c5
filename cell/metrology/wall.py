"""How much of the bore's wall the camera sees: a thick sheet shows two rims.

The bore's edge on the far face is the near one moved along the normal by the thickness. Where its
picture falls inside the near rim, a strip of wall lies between the two, brighter than the hole and
darker than the sheet; an edge finder that knows two levels only is drawn to its far side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.ellipse import Ellipse, project_circle
from cell.metrology.features import Expected

USUAL_THICKNESS = 1.2  # mm
USUAL_SHARE = 0.15     # of the step from hole to sheet, taken by a wall that is known to show
USUAL_TILT = 0.06      # rad, the standard deviation of a tilt that nothing is known of


@dataclass(frozen=True, eq=False)
class Wall:
    """The far rim against the near one, px: moved by `shift` (2,), each +- `sigma`, and smaller
    by `shrink`. `share` is what part of the step from hole to sheet a wall usually takes.
    """

    shift: Array
    sigma: float
    shrink: float
    share: float

    @property
    def widest(self) -> float:
        """How wide the wall may show on one side, px."""
        return float(self.shrink + np.linalg.norm(self.shift) + self.sigma)

    def width(self, normals: Array) -> Array:
        """Say how wide the wall shows, px, at outward normals (n, 2); negative where hidden."""
        return self.shrink - normals @ self.shift


def predict_wall(rim: Ellipse, camera: CameraModel, expected: Expected) -> Wall:
    """Predict the visible wall from thickness, tilt and distance, as far as they are known."""
    ray = camera.rays(rim.centre)
    depth = float(expected.centre[2]) if expected.centre is not None else 250.0
    thickness = USUAL_THICKNESS if expected.thickness is None else expected.thickness
    normal = -ray / np.linalg.norm(ray) if expected.normal is None else expected.normal
    normal = normal * -np.sign(normal[2])
    centre, radius = depth * ray, rim.radius * depth / camera.matrix[0, 0]
    near = project_circle(camera, centre, normal, radius)
    far = project_circle(camera, centre - thickness * normal, normal, radius)
    unsure = USUAL_TILT if expected.normal is None else expected.normal_sigma
    if expected.thickness is None:
        unsure = np.hypot(unsure, USUAL_TILT)
    sigma = 0.05 + thickness * unsure * float(camera.matrix[0, 0]) / depth
    known = expected.thickness is not None and expected.normal is not None
    return Wall(far.centre - near.centre, sigma, near.radius - far.radius,
                USUAL_SHARE if known else 0.0)
