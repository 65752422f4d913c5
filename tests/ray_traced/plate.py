"""Solid sheets in a stack, and where rays meet them: face, rim or wall.

The plate's frame: origin in the hole's centre on the camera-side face, z into the metal, mm. Rays
come from one eye and are given by their slopes dx/dz, dy/dz; so a point on one is its depth z.
"""

from dataclasses import dataclass

import numpy as np

from ray_traced.shapes import distance_to_nearest

VOID, FACE, RIM, WALL = range(4)
LEVELS = 14      # that a ray is asked at on its way past a rim
HALVINGS = 24    # of a stretch of a mm or two: to 1e-7 mm
HAIR = 1e-6      # mm, for differences


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays (n,) from one eye (3,), by slopes (n, 2)."""

    eye: np.ndarray
    slopes: np.ndarray

    def at(self, z):
        """Give x, y (n, 2) at a depth or depths z."""
        return self.eye[:2] + self.slopes * (np.asarray(z) - self.eye[2])[..., None]

    def __getitem__(self, which):
        return Rays(self.eye, self.slopes[which])


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat sheet from depth `front` on, with openings; the first may have a rim."""

    front: float
    thickness: float
    openings: tuple
    skin: object
    rim: object = None

    @property
    def back(self):
        return self.front + self.thickness

    def outside(self, p):
        """Give the distance (...) of p (..., 2) into the metal, below zero in an opening."""
        return distance_to_nearest(self.openings, p)

    def rim_depth(self, p):
        """Give the depth (...) of the camera-side surface over the plan."""
        depth = np.full(p.shape[:-1], self.front)
        for disc in self.openings if self.rim else ():
            if hasattr(disc, "radius"):
                angle = np.arctan2(p[..., 1] - disc.y, p[..., 0] - disc.x)
                depth = depth + self.rim.depth(disc.distance(p), angle)
        return depth

    def meet(self, rays):
        """Say where rays first meet the sheet: kinds (n,) and depths (n,)."""
        gap = self.outside(rays.at(self.front))
        reach = self.rim.width * 1.5 if self.rim else 0.0
        kinds = np.where(gap >= reach, FACE, VOID).astype(np.int8)
        depths = np.full(len(gap), self.front)
        left = np.flatnonzero(kinds == VOID)
        if self.rim:
            beside = left[gap[left] > -reach]
            kinds[beside], depths[beside] = self._march(rays[beside])
            left = left[kinds[left] == VOID]
        low = self.front + (self.rim.span[1] if self.rim else 0.0)
        caught = left[self.outside(rays[left].at(self.back)) >= 0.0]
        kinds[caught] = WALL
        depths[caught] = self._halve(rays[caught], np.full(len(caught), low),
                                     np.full(len(caught), self.back))
        return kinds, depths

    def _inside(self, rays, z):
        p = rays.at(z)
        return (self.outside(p) >= 0.0) & (z >= self.rim_depth(p))

    def _halve(self, rays, free, metal):
        for _ in range(HALVINGS):
            middle = (free + metal) / 2.0
            inside = self._inside(rays, middle)
            free, metal = np.where(inside, free, middle), np.where(inside, middle, metal)
        return metal

    def _march(self, rays):
        """Follow rays down past the rim, level by level, until they are in the metal."""
        kinds = np.full(len(rays.slopes), VOID, np.int8)
        levels = self.front + np.linspace(*self.rim.span, LEVELS)
        step, depths = levels[1] - levels[0], np.full(len(kinds), self.front)
        for level in levels:
            on = np.flatnonzero(kinds == VOID)
            on = on[self._inside(rays[on], np.full(len(on), level))]
            depths[on] = self._halve(rays[on], np.full(len(on), level - step),
                                     np.full(len(on), level))
            before = self.outside(rays[on].at(depths[on] - HAIR))
            kinds[on] = np.where(before < 0.0, WALL, RIM)
        return kinds, depths

    def normals(self, kinds, points):
        """Give the outward unit normals (n, 3) at points (n, 3) of these kinds."""
        normals = np.tile([0.0, 0.0, -1.0], (len(points), 1))
        rim, wall = kinds == RIM, kinds == WALL
        normals[rim, :2] = _gradient(self.rim_depth, points[rim, :2])
        normals[wall, :2] = -_gradient(self.outside, points[wall, :2])
        normals[wall, 2] = 0.0
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _gradient(function, p):
    across, down = np.array([HAIR, 0.0]), np.array([0.0, HAIR])
    return np.stack([function(p + across) - function(p - across),
                     function(p + down) - function(p - down)], axis=-1) / (2.0 * HAIR)


def open_way(sheets, points, source):
    """Say (n,) whether a source (3,) is seen from points (n, 3) past all of the sheets.

    Openings are convex: a straight way that is free at both faces is free in between.
    """
    free = np.ones(len(points), bool)
    for sheet in sheets:
        for level in (sheet.front, sheet.back):
            share = (level - points[:, 2]) / (source[2] - points[:, 2])
            above = share > 1e-9
            p = points[above, :2] + (source[:2] - points[above, :2]) * share[above, None]
            free[above] &= sheet.outside(p) < 0.0
    return free
