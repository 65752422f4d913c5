"""Grey profiles across a rim that is roughly known, and the edges on them.

Profiles run along the normals of an ellipse, from the hole outward, so that an edge is a distance
from that ellipse and a better ellipse is a linear problem away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.arrays import Grey, Indices, Mask
from cell.metrology.ellipse import Ellipse

SMOOTHING = 0.8  # px, of the picture before edges are looked for


@dataclass(frozen=True, eq=False)
class Band:
    """Profiles across an ellipse: `grey` (n, m) at `offsets` (m,) px along the outward normals."""

    ellipse: Ellipse
    t: Array
    offsets: Array
    grey: Array

    @property
    def step(self) -> float:
        """The distance between samples, px."""
        return float(self.offsets[1] - self.offsets[0])

    @cached_property
    def slope(self) -> Array:
        """How the grey rises outward (n, m), per px."""
        return np.gradient(self.grey, self.step, axis=1)


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges on a band: `ray` (k,) indexes its profiles, `offset` (k,) px, `strength` grey/px."""

    ray: Indices
    offset: Array
    strength: Array

    def __getitem__(self, chosen: Mask) -> Edges:
        """Return the edges of a mask."""
        return Edges(self.ray[chosen], self.offset[chosen], self.strength[chosen])


def spread(half_width: float, step: float) -> Array:
    """Space offsets `step` apart, as far as `half_width` to either side."""
    return np.arange(-half_width, half_width + step / 2.0, step)


def sample_band(image: Image | Grey, ellipse: Ellipse, offsets: Array, rays: int) -> Band:
    """Sample the image at `offsets` (m,) px along the outward normals of an ellipse.

    Bilinear; beyond the image the border's grey goes on.
    """
    t = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    places = ellipse.points(t)[:, None] + offsets[:, None] * ellipse.normals(t)[:, None]
    x, y = np.moveaxis(places.astype(np.float32), -1, 0)
    grey = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return Band(ellipse, t, offsets, grey.astype(np.float64))


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


def smooth_around(image: Image, ellipse: Ellipse, margin: float) -> Grey:
    """Smooth the part of the image around an ellipse; the rest is left as zeros."""
    height, width = image.shape
    reach = ellipse.radius + margin + 4.0
    x, y = ellipse.centre
    left, right = (int(np.clip(x + side * reach, 0, width)) for side in (-1, 1))
    top, bottom = (int(np.clip(y + side * reach, 0, height)) for side in (-1, 1))
    smooth: Grey = np.zeros(image.shape, dtype=np.float32)
    part = image[top:bottom, left:right].astype(np.float32)
    if part.size:
        smooth[top:bottom, left:right] = cv2.GaussianBlur(part, (0, 0), SMOOTHING)
    return smooth
