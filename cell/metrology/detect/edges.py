"""The edges on the profiles across a rim: all of them, right and wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.metrology.arrays import Indices, Mask
from cell.metrology.detect.band import Band


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


def find_edges(band: Band, inside: int, least: float) -> Edges:
    """Find every edge on every profile that rises by `least` grey/px out of the hole.

    Args:
        band: the profiles.
        inside: -1 where the hole is darker than the metal (the grey rises outward), else +1.
        least: the smallest slope that counts.
    """
    slope = -inside * band.slope
    middle, before, after = slope[:, 1:-1], slope[:, :-2], slope[:, 2:]
    ray, column = np.nonzero((middle > before) & (middle >= after) & (middle > least))
    peak, left, right = (part[ray, column] for part in (middle, before, after))
    shift = (left - right) / (2.0 * (left - 2.0 * peak + right))  # the summit of a parabola
    return Edges(ray, band.offsets[column + 1] + shift * band.step, peak)
