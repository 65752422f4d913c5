"""How much of the bore's wall the camera sees: a thick sheet shows two rims.

The bore's edge on the far face is the near one moved along the normal by the thickness. Where its
picture falls inside the near rim, a strip of wall lies between the two, brighter than the hole and
darker than the sheet; an edge finder that knows two levels only is drawn to its far side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.detect.ellipse import Ellipse, project_circle
from cell.metrology.detect.find_holes import Hole
from cell.metrology.detect.profile import Profile
from cell.metrology.features import Expected

USUAL_THICKNESS = 1.2   # mm
USUAL_DISTANCE = 250.0  # mm
SUSPECTED = 3.5         # px, the shift of a far rim that shows without having been predicted
LITTLE, MUCH = 0.98, 0.85      # of the misfit: evidence for a wall that was expected, or not
HARDLY, BRIGHTLY = 0.02, 0.25  # share, of the step from hole to sheet, that walls take or do not
WALL_GREY = 0.08        # of the sheet's: a wall that the light passes along is nearly black
BROAD, BROAD_DOUBT = 2.0, 0.3  # px of wall, and what share of the rest is doubted
USUAL_TILT = 0.06       # rad, the standard deviation of a tilt that nothing is known of


@dataclass(frozen=True, eq=False)
class Wall:
    """The far rim against the near one, px: moved by `shift` (2,), each +- `sigma`, and smaller
    by `shrink`. `share` is what part of the step from hole to sheet the wall takes, `share_sigma`
    how well that is known; `worth` the share of the misfit that has to remain below for the wall to
    be believed.
    """

    shift: Array
    sigma: float
    shrink: float
    share: float
    share_sigma: float
    worth: float = 1.0

    @property
    def widest(self) -> float:
        """How wide the wall may show on one side, px."""
        return float(self.shrink + np.linalg.norm(self.shift) + self.sigma)

    def width(self, normals: Array) -> Array:
        """Say how wide the wall shows, px, at outward normals (n, 2); negative where hidden."""
        return self.shrink - normals @ self.shift


def predict_wall(rim: Ellipse, hole: Hole, camera: CameraModel, expected: Expected) -> Wall:
    """Predict the visible wall from thickness, tilt and distance, as far as they are known.

    Before something lit the wall is a dark ring, too narrow to be seen by itself as a rule. Under
    an opening brighter than the sheet the wall is as dark as the sheet, or darker.
    """
    ray = camera.rays(rim.centre)
    depth = float(expected.centre[2]) if expected.centre is not None else USUAL_DISTANCE
    thickness = USUAL_THICKNESS if expected.thickness is None else expected.thickness
    normal = -ray / np.linalg.norm(ray) if expected.normal is None else expected.normal
    normal = normal * -np.sign(normal[2])
    scale = float(camera.matrix[0, 0]) / depth
    near = project_circle(camera, depth * ray, normal, rim.radius / scale)
    far = project_circle(camera, depth * ray - thickness * normal, normal, rim.radius / scale)
    known = is_known(expected)
    unsure = expected.normal_sigma if known else USUAL_TILT
    share, share_sigma = 1.0, BRIGHTLY if known else HARDLY
    if hole.inside < 0:
        share = min(0.0, (WALL_GREY - hole.glow) / (1.0 - hole.glow))
        share_sigma = HARDLY - BRIGHTLY * share
    return Wall(far.centre - near.centre, 0.05 + thickness * unsure * scale,
                near.radius - far.radius, share, share_sigma)


def is_known(expected: Expected) -> bool:
    """Tell whether enough is known of a sheet to predict how wide the wall shows."""
    return expected.thickness is not None and expected.normal is not None


def doubt_of_wall(wall: Wall, profile: Profile) -> float:
    """Say how far (px) a wall may have drawn the rim where nobody could predict its width."""
    broad = max(float(profile.width.max()) - BROAD, 0.0)
    return abs(wall.share) * wall.sigma + BROAD_DOUBT * broad


def lit(wall: Wall) -> Wall:
    """Let the wall be as bright as it may; before something lit, a dark one is far likelier."""
    return replace(wall, share=max(wall.share, BRIGHTLY), share_sigma=BRIGHTLY,
                   worth=MUCH if wall.share < -BRIGHTLY / 2.0 else LITTLE)


def suspect_walls(predicted: Wall) -> list[Wall]:
    """List walls on all sides, for a rim that shows two edges where nothing was predicted."""
    turn = np.arange(8) * np.pi / 4.0
    return [Wall(SUSPECTED * np.array([np.cos(t), np.sin(t)]), SUSPECTED / 2.0, predicted.shrink,
                 0.5, BRIGHTLY, worth=MUCH) for t in turn]
