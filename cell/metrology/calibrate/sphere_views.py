"""Where to look at a sphere from: so that what is wrong shows as a centre that moves.

An error in depth moves the centre along the line of sight. A section tells of its own plane alone,
so that the camera leans to and fro along the stripe, at many rolls.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array, Transform
from cell.core.optics import SensorModel
from cell.metrology.detect.ridge import runs_upright

LEAN_DEG = 24.0
ASIDE_DEG = 6.0
GOLDEN = 0.6180339887498949
DEEPER = (0.45, 0.75)  # radii that the centre is behind the light plane: where to cut


def draw_sphere_views(count: int, sensor: SensorModel, centre_in_base: Array,
                      radius: float) -> list[Transform]:
    """Draw `base_from_camera` of views from above, leaning one way and the other in turns."""
    return [_draw(index, sensor, centre_in_base, radius) for index in range(count)]


def _draw(index: int, sensor: SensorModel, centre: Array, radius: float) -> Transform:
    roll, share = (np.mod((index + 1) * step, 1.0) for step in (GOLDEN, np.sqrt(3.0)))
    lean, aside = LEAN_DEG * (-1.0) ** index * (0.6 + 0.4 * share), ASIDE_DEG * (2.0 * share - 1.0)
    leans = [lean, aside] if runs_upright(sensor.light_plane) else [aside, lean]
    turn = (Rotation.from_euler("x", np.pi) * Rotation.from_euler("z", 2.0 * np.pi * roll)
            * Rotation.from_euler("xy", leans, degrees=True)).as_matrix()
    sight = sensor.camera.rays((np.array(sensor.camera.image_size) - 1.0) / 2.0)
    deeper = radius * (DEEPER[0] + share * (DEEPER[1] - DEEPER[0]))
    middle = sensor.light_plane.meet(sight) + deeper * sight
    return Transform.from_parts(turn, centre - turn @ middle)
