"""Holes as the camera sees them: the rim, the wall of the sheet, and what lies behind.

A pixel on an edge is shared out among what its sub-rays meet: true area sampling.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.core.geometry import Array
from cell.sim.bodies import Bore, Sheet
from cell.sim.materials import FINISHES
from cell.sim.render_face import Face, Window, ring_light, stripe_light, textured
from cell.sim.render_lens import Lens, Light, Rays
from cell.sim.render_light import Lamps

FACE, BREAK, WALL, THROUGH = range(4)
BREAK_SHINE = 0.6    # of the face's light, where it bends away at the rim
WALL_SHINE = 0.8     # a punched wall: burnished above, torn below
DARKNESS = 0.03      # of the surroundings' light, out of the body's inside
SHADOW_NODES = 33    # across a hole, where the second sheet's light is worked out


@dataclass(frozen=True, eq=False)
class Cut:
    """A bore through a sheet, as the camera sees it."""

    face: Face
    sheet: Sheet
    bore: Bore

    def beyond(self, rays: Rays) -> tuple[Array, Array]:
        """Return how far outside of the outer and of the inner rim rays (...) pass, mm."""
        inner = self.face.deeper(self.sheet.thickness)
        return self._outside(self.face, rays), self._outside(inner, rays)

    def kinds(self, outer: Array, inner: Array) -> Array:
        """Tell what is met so far beyond the rims: FACE, BREAK, WALL or THROUGH."""
        inside = np.where(inner > 0.0, WALL, THROUGH)
        return np.where(outer > self.sheet.edge_break, FACE, np.where(outer > 0.0, BREAK, inside))

    def _outside(self, face: Face, rays: Rays) -> Array:
        _, u, v = face.places(rays)
        return self.bore.outside(u, v)


def seen_in_bore(lens: Lens, lamps: Lamps, cut: Cut, window: Window, face_seen: Light) -> Light:
    """Return the light of a window that holds a hole, given that of the face without it."""
    shares = _shares(lens, cut, window)
    light = face_seen * (shares[FACE] + BREAK_SHINE * shares[BREAK])
    if (shares[WALL] > 0.0).any():
        light += shares[WALL] * _wall(lens, lamps, cut, window, shares[WALL] > 0.0)
    return light + shares[THROUGH] * _behind(lens, lamps, cut, window)


def _shares(lens: Lens, cut: Cut, window: Window) -> Light:
    """Return how much of each pixel is FACE, BREAK, WALL and THROUGH: (4, height, width)."""
    outer, inner = cut.beyond(lens.rays.at(*window))
    every = np.arange(4)[:, None, None]
    shares = (cut.kinds(outer, inner) == every).astype(np.float32)
    reach = 1.2 * cut.face.distance / lens.sensor.camera.matrix[0, 0]
    edges = np.abs(outer), np.abs(outer - cut.sheet.edge_break), np.abs(inner)
    rows, columns = np.nonzero(np.minimum.reduce(edges) < reach)
    fine = cut.beyond(lens.sub_rays(rows + window[0].start, columns + window[1].start))
    shares[:, rows, columns] = (cut.kinds(*fine) == every).mean(axis=2)
    return shares


def _wall(lens: Lens, lamps: Lamps, cut: Cut, window: Window, seen: Array) -> Light:
    """Return the light of the bore's wall where it is seen."""
    rays = lens.rays.at(*window)
    rays = Rays(rays.x[seen], rays.y[seen])
    depth, inward, share = _meet_wall(cut, rays)
    points = np.stack([rays.x * depth, rays.y * depth, depth], axis=-1)
    burnished = np.where(share < 0.4, 1.0, 0.5)
    level = lamps.ring_on(points, inward, FINISHES["steel"])
    if lamps.laser:
        facing = np.maximum(np.sum((lamps.laser_at - points) * inward, axis=-1), 0.0)
        level = level + (FINISHES["steel"].stripe * lamps.stripe_on(rays, depth) * facing
                         / np.linalg.norm(lamps.laser_at - points, axis=-1))
    light = np.zeros(seen.shape, np.float32)
    light[seen] = WALL_SHINE * burnished * level
    return light


def _meet_wall(cut: Cut, rays: Rays) -> tuple[Array, Array, Array]:
    """Follow rays (n,) to the far wall of the bore: depth z, inward normal (n, 3) in the camera
    frame, and how deep in the sheet as a share of its thickness.
    """
    turn = cut.face.camera_from_face.rotation
    eye = cut.face.camera_from_face.inverse.translation - [*cut.bore.centre, 0.0]
    way = np.stack([rays.x, rays.y, np.ones_like(rays.x)], axis=-1) @ turn
    a = np.sum(way[:, :2] ** 2, axis=-1)
    b = way[:, :2] @ eye[:2]
    c = eye[:2] @ eye[:2] - cut.bore.radius**2
    depth = (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / np.maximum(a, 1e-12)
    height = np.clip(eye[2] + depth * way[:, 2], -cut.sheet.thickness, 0.0)
    depth = (height - eye[2]) / way[:, 2]
    inward = -(eye[:2] + depth[:, None] * way[:, :2]) / cut.bore.radius
    inward = np.column_stack([inward, np.zeros(len(depth))]) @ turn.T
    return depth, inward, -height / cut.sheet.thickness


def _behind(lens: Lens, lamps: Lamps, cut: Cut, window: Window) -> Light | float:
    """Return the light that comes through the hole."""
    behind = cut.sheet.behind
    if behind is None:
        return DARKNESS * lamps.design.ambient_level
    face = cut.face.deeper(cut.sheet.thickness + behind.gap_mm)
    depth, u, v = face.places(lens.rays.at(*window))
    light = ring_light(lens, lamps, face, behind.finish)[window]
    light = light * _lit(cut, behind.gap_mm, lamps, u, v)
    if lamps.laser:
        reached = _passes(cut, behind.gap_mm, u, v, lamps.laser_at)
        light += reached * stripe_light(lens, lamps, behind.finish, depth, window)
    return light * textured(behind.finish, u, v)


def _lit(cut: Cut, gap: float, lamps: Lamps, u: Array, v: Array) -> Light:
    """Return the share of the ring that reaches places `gap` mm behind the sheet by the hole."""
    across = np.linspace(u.min(), u.max(), SHADOW_NODES)
    down = np.linspace(v.min(), v.max(), SHADOW_NODES)
    nodes = np.meshgrid(across, down)
    lit = np.mean([_passes(cut, gap, *nodes, led) for led in lamps.leds], axis=0, dtype=np.float32)
    scale = SHADOW_NODES - 1
    return cv2.remap(lit, (scale * (u - across[0]) / np.ptp(across)).astype(np.float32),
                     (scale * (v - down[0]) / np.ptp(down)).astype(np.float32), cv2.INTER_LINEAR)


def _passes(cut: Cut, gap: float, u: Array, v: Array, lamp: Array) -> NDArray[np.bool_]:
    """Tell whether light from a lamp (camera frame) gets by the hole to places `gap` mm behind."""
    lamp_u, lamp_v, height = cut.face.camera_from_face.inverse @ lamp
    deep = cut.sheet.thickness + gap
    way = [part / (height + deep) for part in (gap, deep)]
    rims = [cut.bore.outside(u + part * (lamp_u - u), v + part * (lamp_v - v)) for part in way]
    return np.maximum(*rims) < 0.0
