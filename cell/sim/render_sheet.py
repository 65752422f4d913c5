"""Sheets of metal as the camera sees them: their faces, with the holes cut out of them."""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Transform
from cell.sim.bodies import Bore, Sheet
from cell.sim.render_bore import Cut, seen_in_bore
from cell.sim.render_face import Face, Layer, Window, covered, face_light
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps


def render_sheet(lens: Lens, lamps: Lamps, camera_from_sheet: Transform,
                 sheet: Sheet) -> Layer | None:
    """Render a sheet of a body, or nothing where it is out of sight or seen from behind."""
    face = Face(camera_from_sheet)
    half = np.array(sheet.size) / 2.0
    if not face.in_sight(lens, half):
        return None
    depth = face.depth(lens.rays)
    u, v = face.place(lens.rays, depth)
    light = face_light(lens, lamps, face, sheet.finish, (depth, u, v))
    for bore in sheet.bores:
        window = _window(lens, camera_from_sheet, bore)
        if window is not None:
            light[window] = seen_in_bore(lens, lamps, Cut(face, sheet, bore), window,
                                         light[window])
    return Layer(light, covered(lens, u, v, half, depth), face.distance)


def _window(lens: Lens, camera_from_sheet: Transform, bore: Bore) -> Window | None:
    """Return the rectangle of pixels that a bore may touch, if any."""
    if bore.radius == 0.0:
        return None
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    circle = 1.1 * bore.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    rim = camera_from_sheet @ np.column_stack([bore.centre + circle, np.zeros(16)])
    low, high = _span(lens.sensor.camera.project(rim))
    height, width = lens.shape
    left, right = max(low[0], 0), min(high[0], width)
    top, bottom = max(low[1], 0), min(high[1], height)
    return None if left >= right or top >= bottom else (slice(top, bottom), slice(left, right))


def _span(pixels: Array) -> tuple[list[int], list[int]]:
    low, high = np.floor(pixels.min(axis=0)) - 4, np.ceil(pixels.max(axis=0)) + 5
    return [int(value) for value in low], [int(value) for value in high]
