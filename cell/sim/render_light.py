"""The lamps: how much of the ring and of the laser reaches a surface and comes back to the lens.

All in the camera frame, mm. Light is in grey values a second of exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cell.core.geometry import Array
from cell.sim.materials import Finish
from cell.sim.render_lens import Light, Rays
from cell.sim.scene import SensorScene
from cell.sim.world import TrueSensor

LEDS = 16
FAINT = 1.0  # grey values a second that no exposure shows
GRAZING = 0.05


@dataclass(frozen=True, eq=False)
class Lamps:
    """The lamps as they burn at the moment of exposure. `grain` seeds the speckle."""

    sensor: TrueSensor
    ring: bool
    laser: bool
    grain: int

    @property
    def design(self) -> SensorScene:
        """What the maker drew."""
        return self.sensor.design

    @cached_property
    def leds(self) -> Array:
        """Where the ring's light comes from, (LEDS, 3)."""
        angle = 2.0 * np.pi * (np.arange(LEDS) + 0.5) / LEDS
        circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(LEDS)], axis=-1)
        return self.design.ring_radius_mm * circle

    @cached_property
    def laser_at(self) -> Array:
        """Where the laser's light comes from (3,)."""
        return np.array(self.design.laser)

    def ring_on(self, points: Array, normal: Array, finish: Finish) -> Array:
        """Return the light of ring and surroundings that points (..., 3) of a surface send back.

        `normal` is (3,) or (..., 3), towards the camera.
        """
        ambient = self.design.ambient_level * (finish.diffuse + finish.gloss)
        if not self.ring:
            return np.full(points.shape[:-1], ambient)
        view = -points / np.linalg.norm(points, axis=-1, keepdims=True)
        total = np.zeros(points.shape[:-1])
        for led in self.leds:
            way = led - points
            far2 = np.sum(way * way, axis=-1)
            way = way / np.sqrt(far2)[..., None]
            cosine = np.maximum(np.sum(way * normal, axis=-1), 0.0)
            half = way + view
            slope2 = _slope2(half, normal)
            shine = finish.diffuse + finish.gloss * np.exp(-slope2 / finish.lobe**2)
            total += cosine * shine / far2
        nearest2 = self._distance**2 + self.design.ring_radius_mm**2
        return ambient + self.design.ring_level * nearest2 / LEDS * total

    def stripe_on(self, rays: Rays, depth: Array) -> Light:
        """Return the sheet of light's brightness on a white sheet where rays end at `depth` (z)."""
        across = depth * rays.along(self.sensor.light_plane.normal) + self.sensor.light_plane.offset
        sigma = self.design.stripe_sigma_mm
        bell = np.exp(-0.5 * np.minimum((across / sigma) ** 2, 60.0))
        return (self.design.laser_level * bell).astype(np.float32)

    def speckled(self, stripe: Light, finish: Finish) -> Light:
        """Break laser light up into speckles of a pixel, which the lens then correlates."""
        lit = stripe > FAINT
        rows, columns = np.nonzero(lit.any(axis=1))[0], np.nonzero(lit.any(axis=0))[0]
        contrast = finish.speckle * self.design.speckle
        if not len(rows) or contrast == 0.0:
            return stripe
        window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        chance = np.random.default_rng(self.grain)
        field = chance.standard_normal(stripe[window].shape, dtype=np.float32)
        spread = np.sqrt(np.log1p(contrast**2))
        out = stripe.copy()
        out[window] *= np.exp(spread * field - 0.5 * spread**2)
        return out

    @cached_property
    def _distance(self) -> float:
        plane = self.sensor.light_plane
        return -plane.offset / float(plane.normal[2])


def _slope2(half: Array, normal: Array) -> Array:
    """Return the squared tangent of the angle between half vectors (..., 3) and the normal."""
    along = np.maximum(np.sum(half * normal, axis=-1), GRAZING)
    return np.sum(half * half, axis=-1) / along**2 - 1.0
