"""Grey profiles across a rim that is roughly known.

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
from cell.metrology.arrays import Grey, Indices
from cell.metrology.detect.ellipse import Ellipse

SMOOTHING = 0.8  # px, of the picture before edges are looked for
SOFT = 4.0       # px to either side: what rises as evenly over so much is no edge of the sheet


@dataclass(frozen=True, eq=False)
class Patch:
    """A smoothed part of an image; its first pixel is the pixel `origin` (x, y) of the image."""

    grey: Grey
    origin: Array


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
        return np.asarray(np.gradient(self.grey, self.step, axis=1))

    @cached_property
    def sharp(self) -> Array:
        """How far the slope stands out of its surroundings (n, m), per px: shadows go out."""
        width = 2 * round(SOFT / self.step) + 1
        return self.slope - cv2.blur(self.slope, (width, 1), borderType=cv2.BORDER_REFLECT)

    @cached_property
    def normals(self) -> Array:
        """The unit outward normals (n, 2) that the profiles follow."""
        return self.ellipse.normals(self.t)

    @cached_property
    def design(self) -> Array:
        """How the ellipse moves along the profiles with each of its five numbers (n, 5)."""
        return self.ellipse.design(self.t)

    def levels(self, beside: float) -> tuple[Array, Array]:
        """Give the mean grey of each profile further than `beside` px inside and outside (n,)."""
        inner, outer = self.offsets < -beside, self.offsets > beside
        return self.grey[:, inner].mean(axis=1), self.grey[:, outer].mean(axis=1)

    def __getitem__(self, rays: Indices) -> Band:
        """Return some of the profiles."""
        return Band(self.ellipse, self.t[rays], self.offsets, self.grey[rays])


def spread(half_width: float, step: float) -> Array:
    """Space offsets `step` apart, as far as `half_width` to either side."""
    return np.arange(-half_width, half_width + step / 2.0, step)


def smooth_around(image: Image, ellipse: Ellipse, margin: float) -> Patch:
    """Smooth the part of an image that an ellipse and a margin (px) around it cover."""
    reach = ellipse.radius + margin + 4.0
    size = np.array(image.shape[::-1])
    first = np.clip(ellipse.centre - reach, 0, size - 1).astype(int)
    last = np.clip(ellipse.centre + reach, first + 1, size).astype(int)
    return smooth(image[first[1]:last[1], first[0]:last[0]], first.astype(np.float64))


def smooth(part: Image, origin: Array) -> Patch:
    """Smooth a part of an image whose first pixel is the pixel `origin` (x, y) of it."""
    return Patch(cv2.GaussianBlur(part.astype(np.float32), (0, 0), SMOOTHING), origin)


def sample_band(patch: Patch, ellipse: Ellipse, offsets: Array, rays: int) -> Band:
    """Sample a patch at `offsets` (m,) px along the outward normals of an ellipse."""
    t = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    return Band(ellipse, t, offsets,
                sample_profiles(patch, ellipse.points(t), ellipse.normals(t), offsets))


def sample_profiles(patch: Patch, feet: Array, normals: Array, offsets: Array) -> Array:
    """Sample a patch at `offsets` (m,) px along unit normals (n, 2) from feet (n, 2) px: (n, m).

    Bilinear; beyond the patch the grey of its border goes on.
    """
    feet = feet - patch.origin
    x, y = ((feet[:, axis, None] + normals[:, axis, None] * offsets).astype(np.float32)
            for axis in (0, 1))
    grey = cv2.remap(patch.grey, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return grey.astype(np.float64)
