"""Flat faces: where lines of sight meet them, their pattern, and the light that they send back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np

from cell.core.geometry import Array, Transform
from cell.sim.materials import FINISHES, TEXEL_MM, pattern
from cell.sim.render_lens import Lens, Light, Rays
from cell.sim.render_light import Lamps

Window: TypeAlias = tuple[slice, slice]
Places: TypeAlias = tuple[Array, Array, Array]
"""Where rays end on a face: depth z in the camera frame, u and v on the face; mm."""

EVERYWHERE: Window = (slice(None), slice(None))


@dataclass(frozen=True, eq=False)
class Layer:
    """What one thing adds to an image: its light, how much of each pixel it covers, its depth."""

    light: Light
    cover: Light
    depth: float


@dataclass(frozen=True, eq=False)
class Face:
    """A plane with axes u, v on it and w towards the camera, as the camera sees it."""

    camera_from_face: Transform

    @property
    def outward(self) -> Array:
        """The normal (3,) in the camera frame."""
        return self.camera_from_face.rotation[:, 2]

    @property
    def distance(self) -> float:
        """The depth z in mm where the optic axis meets the plane."""
        return float(self.outward @ self.camera_from_face.translation / self.outward[2])

    def deeper(self, by: float) -> Face:
        """Return the parallel plane `by` mm behind this one."""
        return Face(self.camera_from_face @ Transform.from_parts(np.zeros(3), [0.0, 0.0, -by]))

    def depth(self, rays: Rays) -> Array:
        """Return z where rays meet the plane."""
        return float(self.outward @ self.camera_from_face.translation) / rays.along(self.outward)

    def place(self, rays: Rays, depth: Array) -> tuple[Array, Array]:
        """Return u and v where rays end at `depth`."""
        origin, axes = self.camera_from_face.translation, self.camera_from_face.rotation
        return (depth * rays.along(axes[:, 0]) - float(origin @ axes[:, 0]),
                depth * rays.along(axes[:, 1]) - float(origin @ axes[:, 1]))

    def places(self, rays: Rays) -> Places:
        """Return depth, u and v where rays meet the plane."""
        depth = self.depth(rays)
        return depth, *self.place(rays, depth)

    def in_sight(self, lens: Lens, half: Array) -> bool:
        """Tell whether any of a rectangle of half size (2,) is in view, from its outer side."""
        depth, u, v = self.places(lens.coarse_rays)
        seen = (depth > 0.0) & (lens.coarse_rays.along(self.outward) < 0.0)
        return bool((seen & (np.abs(u) < half[0]) & (np.abs(v) < half[1])).any())


def covered(lens: Lens, u: Array, v: Array, half: Array, depth: Array) -> Light:
    """Return how much of each pixel a rectangle of half size (2,) covers."""
    inside = np.minimum(float(half[0]) - np.abs(u), float(half[1]) - np.abs(v))
    pixel = depth / float(lens.sensor.camera.matrix[0, 0])
    return (np.clip(0.5 + inside / pixel, 0.0, 1.0) * (depth > 0.0)).astype(np.float32)


def face_light(lens: Lens, lamps: Lamps, face: Face, finish: str, places: Places) -> Light:
    """Return the light that a face sends back along all rays."""
    depth, u, v = places
    light = ring_light(lens, lamps, face, finish)
    if lamps.laser:
        light += stripe_light(lens, lamps, finish, depth)
    return light * textured(finish, u, v)


def stripe_light(lens: Lens, lamps: Lamps, finish: str, depth: Array,
                 window: Window = EVERYWHERE) -> Light:
    """Return the laser's light from a face of a window, without its pattern."""
    surface = FINISHES[finish]
    stripe = lamps.stripe_on(lens.rays.at(*window), depth)
    return surface.stripe * lamps.speckled(stripe, surface)


def ring_light(lens: Lens, lamps: Lamps, face: Face, finish: str) -> Light:
    """Return the ring's and the surroundings' light from a face without its pattern."""
    rays = lens.coarse_rays
    depth = np.clip(face.depth(rays), 50.0, 1000.0)
    points = np.stack([depth * rays.x, depth * rays.y, depth], axis=-1)
    return lens.spread(lamps.ring_on(points, face.outward, FINISHES[finish]))


def textured(finish: str, u: Array, v: Array) -> Light:
    """Return the relative brightness of a finish's pattern at places on a face (mm)."""
    tile = pattern(finish)
    return cv2.remap(tile, (u / TEXEL_MM).astype(np.float32), (v / TEXEL_MM).astype(np.float32),
                     cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
