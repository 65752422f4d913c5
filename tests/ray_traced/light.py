"""Lamps, the laser's fan, and what a surface sends back of them. All in the plate's frame, mm."""

from dataclasses import dataclass

import numpy as np

FAR = 240.0  # mm: a lamp's strength is what it gives a surface that faces it from here


@dataclass(frozen=True, eq=False)
class Lamps:
    """Small lamps at `places` (m, 3), each of `strength`."""

    places: np.ndarray
    strength: float

    def turned(self, turn, origin):
        """Give the lamps in a frame that has its origin there and these axes as columns."""
        return Lamps((self.places - origin) @ turn, self.strength)


def ring(radius, ahead, count=24):
    """A ring light round the lens (camera frame), its lamps `ahead` of the entrance pupil."""
    angle = np.arange(count) * (2.0 * np.pi / count)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle),
                       np.full(count, ahead)], axis=1)
    return Lamps(places, 1.0 / count)


def window(bearing, elevation, strength, distance=900.0, width=160.0):
    """A side light (camera frame): nine lamps over a square, seen from the plate's place."""
    away = distance * np.array([np.cos(elevation) * np.cos(bearing),
                                np.cos(elevation) * np.sin(bearing), -np.sin(elevation)])
    across = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
    up = np.cross(away / distance, across)
    grid = np.linspace(-0.5, 0.5, 3) * width
    middle = away + np.array([0.0, 0.0, FAR])
    places = [middle + a * across + b * up for a in grid for b in grid]
    return Lamps(np.array(places), strength / 9.0 * (distance / FAR) ** 2)


@dataclass(frozen=True, eq=False)
class Fan:
    """A laser line: a sheet of light from `source` (3,) towards `aim` (3,), both in its plane.

    `thickness` is the standard deviation across the plane in mm, `opening` the half angle in rad
    at which the fan has faded.
    """

    source: np.ndarray
    aim: np.ndarray
    normal: np.ndarray
    offset: float
    thickness: float
    opening: float

    def turned(self, turn, origin):
        return Fan((self.source - origin) @ turn, self.aim @ turn, self.normal @ turn,
                   self.offset + float(self.normal @ origin), self.thickness, self.opening)

    def intensity(self, points):
        """Give the light (n,) at points (n, 3), as the strength of a lamp at the source.

        A lamp's light falls off by the square of the distance, a fan's by the distance.
        """
        apart = (points @ self.normal + self.offset) / self.thickness
        towards = points - self.source
        distance = np.sqrt(_dot(towards, towards))
        side = np.cross(self.normal, self.aim)
        angle = np.arctan2(towards @ side, towards @ self.aim)
        return np.exp(-0.5 * apart * apart - (angle / self.opening) ** 4) * (distance / FAR)


@dataclass(frozen=True, eq=False)
class Lobe:
    """How a gloss spreads: roughness (as slopes) along and across a groove direction (3,)."""

    along: float
    across: float
    groove: np.ndarray


def send_back(points, normals, source, eye, lobe):
    """Reflect a lamp at `source` (3,) into the eye (3,): matt and glossy parts (n,), albedo 1.

    The gloss is Ward's anisotropic lobe. Light falls off by the square of the distance.
    """
    lamp, camera = source - points, eye - points
    far = np.sqrt(_dot(lamp, lamp))
    lamp, camera = lamp / far[:, None], camera / np.sqrt(_dot(camera, camera))[:, None]
    facing, seen = _dot(lamp, normals), _dot(camera, normals)
    strength = np.where((facing > 0.0) & (seen > 0.0), (FAR / far) ** 2, 0.0)
    facing, seen = np.maximum(facing, 0.0), np.maximum(seen, 1e-3)
    half = lamp + camera
    upright = np.maximum(_dot(half, normals), 1e-9)
    along = half @ lobe.groove - upright * (normals @ lobe.groove)
    across = np.maximum(_dot(half, half) - upright * upright - along * along, 0.0)
    spread = (along / lobe.along) ** 2 + across / lobe.across ** 2
    height = np.exp(-spread / upright ** 2) / (4.0 * np.pi * lobe.along * lobe.across)
    return strength * facing / np.pi, strength * height * np.sqrt(facing / seen)


def _dot(a, b):
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def sky_share(points, sheets):
    """Give the share (n,) of the even light of all around that reaches points (n, 3) upwards.

    Under a sheet it is what comes through its first opening, taken as a disc of equal width.
    """
    share = np.ones(len(points))
    for sheet in sheets:
        disc = next((part for part in sheet.openings if hasattr(part, "radius")), None)
        depth = points[:, 2] - sheet.back
        under = depth > 1e-6
        if disc is None or not under.any():
            continue
        aside = np.hypot(points[under, 0] - disc.x, points[under, 1] - disc.y)
        depth = points[under, 2] - sheet.front
        a, r = aside * aside + depth * depth, disc.radius ** 2
        root = np.sqrt((a + r) ** 2 - 4.0 * aside * aside * r)
        share[under] *= 0.5 * (1.0 - (a - r) / root)
    return share
