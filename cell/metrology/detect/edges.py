"""The edges on the profiles across a rim: all of them, right and wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.metrology.arrays import Indices, Mask
from cell.metrology.detect.band import Band

FAINTEST = {-1: 0.4, 0: 0.3, +1: 0.4}  # of the usual edge; before something lit it varies more


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges on a band: `ray` (k,) indexes its profiles, `offset` (k,) px, `strength` grey/px."""

    ray: Indices
    offset: Array
    strength: Array

    def __getitem__(self, chosen: Mask) -> Edges:
        """Return the edges of a mask."""
        return Edges(self.ray[chosen], self.offset[chosen], self.strength[chosen])

    def rays(self, count: int) -> Mask:
        """Tell which of `count` profiles carry an edge."""
        return np.bincount(self.ray, minlength=count) > 0


def rise(band: Band, inside: int) -> Array:
    """Give how a band rises out of the hole (n, m), per px; where either sense will do, sharply."""
    return -inside * band.slope if inside else np.abs(band.sharp)


def find_edges(band: Band, inside: int, least: float) -> Edges:
    """Find every edge on every profile that rises by `least` grey/px out of the hole.

    Args:
        band: the profiles.
        inside: -1 where the hole is darker than the metal (the grey rises outward), +1 where it is
            brighter; 0 where that may change round the rim, and only what is sharp is an edge.
        least: the smallest slope that counts.
    """
    slope = rise(band, inside)
    middle, before, after = slope[:, 1:-1], slope[:, :-2], slope[:, 2:]
    ray, column = np.nonzero((middle > before) & (middle >= after) & (middle > least))
    peak, left, right = (part[ray, column] for part in (middle, before, after))
    shift = (left - right) / (2.0 * (left - 2.0 * peak + right))  # the summit of a parabola
    return Edges(ray, band.offsets[column + 1] + shift * band.step, peak)
