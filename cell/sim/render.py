"""The picture of a world: what the true camera sees of what stands before it, as an image.

Independent of the metrology that it is used to judge: rays are followed to surfaces, edges are
sampled by area, nothing is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Transform
from cell.core.observation import Image
from cell.sim.bodies import Body
from cell.sim.render_face import Layer
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps
from cell.sim.render_sheet import render_sheet
from cell.sim.render_target import render_board, render_sphere
from cell.sim.scene import Board, Sphere

NOTHING = 0.2  # of the surroundings' light: the far side of the hall


@dataclass(frozen=True, eq=False)
class Setting:
    """What stands in the cell, in the base frame: a body in its fixture, and targets."""

    base_from_fixture: Transform
    body: Body | None = None
    boards: tuple[Board, ...] = ()
    spheres: tuple[Sphere, ...] = ()


def render(lens: Lens, setting: Setting, base_from_camera: Transform, lamps: Lamps,
           exposure: float, chance: np.random.Generator | None = None) -> Image:
    """Render one exposure.

    Args:
        lens: the true optics.
        setting: what can be seen.
        base_from_camera: where the camera truly is.
        lamps: the lamps as they burn.
        exposure: s.
        chance: the noise of this exposure; None leaves it out.

    Returns:
        Image (height, width), uint8.
    """
    layers = _layers(lens, setting, base_from_camera.inverse, lamps)
    light = np.full(lens.shape, NOTHING * lamps.design.ambient_level, np.float32)
    for layer in sorted(layers, key=lambda layer: -layer.depth):
        light += layer.cover * (layer.light - light)
    distance = min((layer.depth for layer in layers), default=lens.working_distance)
    return lens.expose(light, distance, exposure, chance)


def _layers(lens: Lens, setting: Setting, camera_from_base: Transform,
            lamps: Lamps) -> list[Layer]:
    sheets = setting.body.sheets if setting.body else ()
    camera_from_fixture = camera_from_base @ setting.base_from_fixture
    seen = [render_sheet(lens, lamps, camera_from_fixture @ sheet.fixture_from_sheet, sheet)
            for sheet in sheets]
    for board in setting.boards:
        camera_from_board = camera_from_base @ Transform(np.array(board.base_from_board))
        seen.append(render_board(lens, lamps, camera_from_board, board))
    seen += [render_sphere(lens, lamps, camera_from_base, sphere) for sphere in setting.spheres]
    return [layer for layer in seen if layer is not None]
