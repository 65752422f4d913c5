"""Pictures of the demo cell's board, from poses that the test knows."""

import numpy as np
from made_scenes import demo_scene, demo_world
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.metrology.calibrate.detect_board import BoardDesign
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps

SCENE, WORLD = demo_scene(), demo_world()
TRUTH = WORLD.sensor
BOARD = SCENE.boards[0]
BOARD_DESIGN = BoardDesign(BOARD.squares, BOARD.square_mm, BOARD.marker_mm, BOARD.dictionary)
BASE_FROM_BOARD = Transform(np.array(BOARD.base_from_board))
LENS = Lens(TRUTH)
SETTING = Setting(WORLD.base_from_fixture, None, SCENE.boards, SCENE.spheres)


def random_pose(rng, lean_deg=32.0, roll_deg=90.0):
    """Draw camera_from_board in front of the lens, within the depth of field."""
    lean, about = np.radians(lean_deg) * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    turn = (Rotation.from_rotvec(lean * np.array([np.cos(about), np.sin(about), 0.0]))
            * Rotation.from_euler("z", rng.uniform(-roll_deg, roll_deg), degrees=True))
    middle = TRUTH.camera.rays(np.array([383.5, 287.5])) * rng.uniform(225.0, 262.0)
    aside = np.array([*rng.uniform(-5.0, 5.0, 2), 0.0])
    return Transform.from_parts(turn.as_matrix(),
                                middle + aside - turn.apply(BOARD_DESIGN.middle))


def picture(camera_from_board, rng, *, laser=False):
    """Expose once under the ring light, or with the laser."""
    lamps = Lamps(TRUTH, not laser, laser, int(rng.integers(1 << 30)))
    return render(LENS, SETTING, BASE_FROM_BOARD @ camera_from_board.inverse, lamps,
                  0.004 if laser else 0.008, rng)
