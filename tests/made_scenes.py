"""Worlds for the tests of the simulator: the demo's, and plain ones with nothing in the way."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.sim.bodies import Body, Bore, Delivery, Sheet, body_from_panel
from cell.sim.scene import SceneDocument, read_scene
from cell.sim.world import World, draw_world

DEMO = Path(__file__).parents[1] / "calibration" / "demo" / "scene.yaml"


def demo_scene() -> SceneDocument:
    return read_scene(DEMO)


def demo_world() -> World:
    return draw_world(demo_scene())


def plate(radius: float, *, thickness: float = 1.0, finish: str = "ceramic", centre=(0.0, 0.0),
          behind=None, form=None) -> Body:
    """A sheet with one hole, its frame being the fixture's."""
    form = np.zeros((2, 5)) if form is None else form
    bore = Bore("H", np.array(centre), radius, form, "camera")
    sheet = Sheet("plate", Transform.identity(), (400.0, 400.0), thickness, finish, 0.0, behind,
                  (bore,))
    return Body(Delivery(0), Transform.identity(), (sheet,))


def camera_over(u: float, v: float, *, distance: float = 242.4, tilt_deg=(0.0, 0.0),
                roll_deg: float = 0.0) -> Transform:
    """base_from_camera of a camera that looks at (u, v) of a plate lying in the base's plane."""
    turn = Rotation.from_euler("xyz", [180.0 + tilt_deg[0], tilt_deg[1], roll_deg], degrees=True)
    axis = turn.as_matrix()[:, 2]
    return Transform.from_parts(turn.as_matrix(), np.array([u, v, 0.0]) - distance * axis)


def over_hole(hole: str, *, roll_deg: float = 0.0, lean_deg=(0.0, 0.0)) -> Transform:
    """base_from_flange by design, for a hole of the demo in the middle of the picture."""
    scene = demo_scene()
    wanted = next(entry for entry in scene.holes if entry.id == hole)
    panel = next(entry for entry in scene.panels if entry.name == wanted.panel)
    turn = Rotation.from_euler("xyz", [180.0 + lean_deg[0], lean_deg[1], roll_deg], degrees=True)
    axis = turn.as_matrix()[:, 2]
    panel_from_camera = Transform.from_parts(turn.as_matrix(),
                                             np.array([*wanted.at, 0.0]) - 242.43 * axis)
    base_from_camera = (Transform(np.array(scene.base_from_fixture)) @ body_from_panel(panel)
                        @ panel_from_camera)
    return base_from_camera @ Transform(np.array(scene.flange_from_camera)).inverse
