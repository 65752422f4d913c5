"""What a punch leaves round a hole: a burr that stands up, or a die roll that falls away.

A rim is a height over the plan: `depth(distance, angle)` is how far the surface lies below the
sheet's face (above it: negative), at a distance from the bore's wall, mm, and an angle round it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

ANGLES = np.linspace(-np.pi, np.pi, 8193)  # at which a rim is known; straight in between
LEAST = 0.15                               # of the mean


@dataclass(frozen=True)
class Round:
    """A quantity that varies round the hole: mean times 1 + sum of cosines, never above `most`."""

    mean: float
    waves: tuple = ()  # of (order, amplitude, phase)
    most: float = np.inf

    @cached_property
    def _table(self):
        value = np.ones_like(ANGLES)
        for order, amplitude, phase in self.waves:
            value += amplitude * np.cos(order * ANGLES + phase)
        return np.clip(self.mean * value, LEAST * self.mean, self.most)

    def at(self, angle):
        """Give the quantity at angles (n,) between -pi and pi."""
        return np.interp(angle, ANGLES, self._table)


@dataclass(frozen=True)
class DieRoll:
    """A rounded edge: a quarter of a circle from the face into the bore."""

    radius: Round

    @property
    def width(self):
        return self.radius.most

    @property
    def span(self):
        """Give the highest and the lowest depth of the rim."""
        return 0.0, self.radius.most

    def depth(self, distance, angle):
        radius = self.radius.at(angle)
        into = np.clip(radius - distance, 0.0, radius)
        return radius - np.sqrt(radius * radius - into * into)


@dataclass(frozen=True)
class Burr:
    """A raised lip: `slender` times as high as wide, highest at the bore."""

    lip: Round
    slender: float

    @property
    def width(self):
        return self.lip.most

    @property
    def span(self):
        return -self.slender * self.lip.most, 0.0

    def depth(self, distance, angle):
        lip = self.lip.at(angle)
        return -self.slender * lip * np.cos(np.clip(distance / lip, 0.0, 1.0) * np.pi / 2.0) ** 2
