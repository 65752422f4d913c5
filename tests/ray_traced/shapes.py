"""Openings of a sheet in plan: signed distances, mm, below zero inside the opening.

Points are (..., 2) in the sheet's own plane. A shape's distance is exact near its outline.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Disc:
    """A round hole."""

    x: float
    y: float
    radius: float

    def distance(self, p):
        return np.hypot(p[..., 0] - self.x, p[..., 1] - self.y) - self.radius


@dataclass(frozen=True)
class Block:
    """A rectangle with rounded corners, turned: a slot when the corners meet, or a square."""

    x: float
    y: float
    half_length: float
    half_width: float
    corner: float
    turn: float

    def distance(self, p):
        dx, dy = p[..., 0] - self.x, p[..., 1] - self.y
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        along = np.abs(cos * dx + sin * dy) - (self.half_length - self.corner)
        across = np.abs(cos * dy - sin * dx) - (self.half_width - self.corner)
        outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        return outside + np.minimum(np.maximum(along, across), 0.0) - self.corner


@dataclass(frozen=True)
class Beyond:
    """All that lies farther than `reach` in the direction `turn`: a sheet ends there."""

    turn: float
    reach: float

    def distance(self, p):
        return self.reach - np.cos(self.turn) * p[..., 0] - np.sin(self.turn) * p[..., 1]


@dataclass(frozen=True)
class Both:
    """Where all of several shapes are open."""

    parts: tuple

    def distance(self, p):
        return np.max([part.distance(p) for part in self.parts], axis=0)


@dataclass(frozen=True)
class Join:
    """Where any of several shapes is open."""

    parts: tuple

    def distance(self, p):
        return distance_to_nearest(self.parts, p)


def distance_to_nearest(openings, p):
    """Give the signed distance (...) of points to the nearest of the openings."""
    nearest = np.full(p.shape[:-1], np.inf)
    for opening in openings:
        np.minimum(nearest, opening.distance(p), out=nearest)
    return nearest
