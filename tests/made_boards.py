"""Pictures of the demo cell's board, from poses that the test knows."""

from dataclasses import replace

import numpy as np
from made_scenes import camera_over, demo_scene, demo_world, plate
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


def picture(camera_from_board, rng, *, laser=False, lens=LENS, setting=SETTING, exposure=0.008):
    """Expose once under the ring light, or with the laser."""
    lamps = Lamps(lens.sensor, not laser, laser, int(rng.integers(1 << 30)))
    return render(lens, setting, BASE_FROM_BOARD @ camera_from_board.inverse, lamps,
                  0.004 if laser else exposure, rng)


def lens_with(**design):
    """The demo's lens and chip, some of it otherwise: `blur_px`, `read_noise`."""
    return Lens(replace(TRUTH, design=TRUTH.design.model_copy(update=design)))


def sharp_rim(lens, rng, radius=5.0):
    """A picture of a hole with a sharp rim, at the working distance."""
    at, tilt = rng.uniform(-0.5, 0.5, 2), rng.uniform(-4.0, 4.0, 2)
    lamps = Lamps(lens.sensor, True, False, int(rng.integers(1 << 30)))
    return render(lens, Setting(Transform.identity(), plate(radius)),
                  camera_over(*at, distance=lens.working_distance, tilt_deg=tilt), lamps, 0.006,
                  rng)
