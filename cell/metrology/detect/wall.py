"""How much of the bore's wall the camera sees: a thick sheet shows two rims.

The bore's edge on the far face is the near one moved along the normal by the thickness. Where its
picture falls inside the near rim, a strip of wall lies between the two: brighter than a dark hole
and darker than the sheet, so that an edge finder that knows two levels only is drawn to its far
side; or darker than both, where something behind is lit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.detect.ellipse import Ellipse, project_circle
from cell.metrology.detect.find_holes import Hole
from cell.metrology.features import Expected

USUAL_THICKNESS = 1.2   # mm
USUAL_DISTANCE = 250.0  # mm
SUSPECTED = 3.5         # px, the shift of a far rim that shows without having been predicted
LITTLE, MUCH = 0.98, 0.85      # of the misfit: evidence for a wall that was expected, or not
HARDLY, BRIGHTLY = 0.02, 0.25  # share, of the step from hole to sheet, that walls take or do not
LIKELY_GLOW = 0.4       # of the sheet's grey, beyond which a wall is no less surely dark
WALL_GREY = 0.08        # of the sheet's: a wall that the light passes along is nearly black
USUAL_TILT = 0.06       # rad, the standard deviation of a tilt that nothing is known of


@dataclass(frozen=True, eq=False)
class Wall:
    """The far rim against the near one, px: moved by `shift` (2,), each +- `sigma`, and smaller
    by `shrink`. `shade` is the wall's grey as a profile has it, `shade_sigma` how well that is
    known; `sloped` and `backlight` are those of the profile; `worth` the share of the misfit that
    has to remain below for the wall to be believed.
    """

    shift: Array
    sigma: float
    shrink: float
    shade: float
    shade_sigma: float
    sloped: bool = False
    backlight: bool = False
    worth: float = 1.0

    @property
    def widest(self) -> float:
        """How wide the wall may show on one side, px."""
        return float(self.shrink + np.linalg.norm(self.shift) + self.sigma)

    def width(self, normals: Array) -> Array:
        """Say how wide the wall shows, px, at outward normals (n, 2); negative where hidden."""
        return self.shrink - normals @ self.shift


def predict_wall(rim: Ellipse, hole: Hole, camera: CameraModel, expected: Expected) -> Wall:
    """Predict the visible wall from thickness, tilt and distance, as far as they are known."""
    ray = camera.rays(rim.centre)
    depth = float(expected.centre[2]) if expected.centre is not None else USUAL_DISTANCE
    thickness = USUAL_THICKNESS if expected.thickness is None else expected.thickness
    normal = -ray / np.linalg.norm(ray) if expected.normal is None else expected.normal
    normal = normal * -np.sign(normal[2])
    scale = float(camera.matrix[0, 0]) / depth
    near = project_circle(camera, depth * ray, normal, rim.radius / scale)
    far = project_circle(camera, depth * ray - thickness * normal, normal, rim.radius / scale)
    unsure = expected.normal_sigma if is_known(expected) else USUAL_TILT
    return Wall(far.centre - near.centre, 0.05 + thickness * unsure * scale,
                near.radius - far.radius, *_shade(hole, expected), hole.lit, hole.inside > 0)


def _shade(hole: Hole, expected: Expected) -> tuple[float, float]:
    """Say how bright the wall is, and how surely: as the dark that it stands before, or a dark ring
    before something lit. Before a backlight it is as dark as the sheet.
    """
    if hole.inside > 0:
        return 0.0, BRIGHTLY if is_known(expected) else HARDLY
    beyond = float(np.clip(hole.glow - WALL_GREY, 0.0, LIKELY_GLOW))
    return (min(WALL_GREY, hole.glow) - _dark(hole),
            HARDLY * max(1.0 - hole.glow, 0.0) + BRIGHTLY * beyond)


def _dark(hole: Hole) -> float:
    """Give the shade of the dark behind a hole, which a profile counts a wall's shade from."""
    return 0.0 if hole.lit else hole.glow


def is_known(expected: Expected) -> bool:
    """Tell whether enough is known of a sheet to predict how wide the wall shows."""
    return expected.thickness is not None and expected.normal is not None


def lit(wall: Wall, hole: Hole) -> Wall:
    """Let the wall be as bright as it may; before something lit, a dark one is far likelier."""
    if hole.inside > 0:
        return replace(wall, shade_sigma=BRIGHTLY, worth=LITTLE)
    between = min(hole.glow + BRIGHTLY * (1.0 - hole.glow), 1.0) - _dark(hole)
    sigma = BRIGHTLY * max(1.0 - hole.glow, LIKELY_GLOW)
    return replace(wall, shade=max(wall.shade, between), shade_sigma=sigma,
                   worth=MUCH if wall.shade + _dark(hole) + BRIGHTLY / 2.0 < min(hole.glow, 1.0)
                   else LITTLE)


def suspect_walls(predicted: Wall) -> list[Wall]:
    """List walls on all sides, for a rim that shows two edges where nothing was predicted: lit ones
    before something dark, and dark ones before something lit.
    """
    turn = np.arange(8) * np.pi / 4.0
    one = predicted if predicted.sloped else replace(predicted, shade=0.5, shade_sigma=BRIGHTLY)
    return [replace(one, shift=SUSPECTED * np.array([np.cos(t), np.sin(t)]),
                    sigma=SUSPECTED / 2.0, worth=MUCH) for t in turn]
