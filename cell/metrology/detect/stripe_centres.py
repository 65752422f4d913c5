"""The centre of the stripe, line by line: the one extractor of measuring and of calibrating.

Both must see the same stripe the same way: what its centre is off by then stands in the light plane
as well, and cancels.
"""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.arrays import Indices

HALF_WINDOW = 10  # px across the stripe: four standard deviations of a usual one
FAR = 48          # px to either side of its course, where a stripe that blooms is looked for
BROAD = 9         # px, the full width at half height of a stripe that needs a wider window
WINDOW = 1.7      # of that width: four standard deviations
FLOOR = 0.2       # of the stripe's height, below which nothing counts towards its centre


class Course(Protocol):
    """Where a stripe runs, to a pixel or two: a straight ridge, or an arc."""

    @property
    def upright(self) -> bool:
        """Whether it runs along the image's columns."""

    def across(self, v: Array) -> Array:
        """Say where it lies across its length, at each v."""


def centre_stripe(image: Image, course: Course, v: Array) -> tuple[Array, Array]:
    """Locate the stripe on lines v (n,) of the image: u (n,) across it, and its height (n,) grey.

    The ground is a ramp between the grey on either side; the centre is that of mass of what stands
    out of it.
    """
    u, grey = _cut(image, course.upright, *_window(image, course, v))
    height = grey.max(axis=1)
    weight = np.clip(grey - FLOOR * height[:, None], 0.0, None)
    total = np.maximum(weight.sum(axis=1), 1e-9)
    return (weight * u).sum(axis=1) / total, height


def _window(image: Image, course: Course, v: Array) -> tuple[Indices, Indices]:
    """Choose the pixels to weigh: lines (n, 1) and, across them, u (n, m).

    Too much light lets a stripe bloom to several times its width, and its course may then follow
    one of its sides.
    """
    lines, middle = v.astype(np.intp)[:, None], np.rint(course.across(v)).astype(np.intp)[:, None]
    low, high = _extent(image, course.upright, lines[::4], middle[::4])
    shift, half = 0, HALF_WINDOW
    if high - low >= BROAD:
        shift, half = (low + high) // 2, int(WINDOW * (high - low + 1))
    return lines, middle + np.arange(shift - half, shift + half + 1)


def _extent(image: Image, upright: bool, lines: Indices, middle: Indices) -> tuple[int, int]:
    """Say from where to where, px beside its course, the stripe is more than half as bright."""
    offsets = np.arange(-FAR, FAR + 1)
    usual = np.median(_grey(image, upright, lines, middle + offsets), axis=0)
    peak, ground = int(usual.argmax()), float(np.median(usual))
    dark = np.flatnonzero(usual <= (ground + float(usual[peak])) / 2.0)
    low, high = dark[dark < peak].max(initial=-1) + 1, dark[dark > peak].min(initial=len(usual)) - 1
    return int(offsets[low]), int(offsets[high])


def _grey(image: Image, upright: bool, lines: Indices, u: Indices) -> Array:
    turned = image if upright else image.T
    return turned[lines, np.clip(u, 0, turned.shape[1] - 1)].astype(np.float64)


def _cut(image: Image, upright: bool, lines: Indices, u: Indices) -> tuple[Array, Array]:
    """Cut across the stripe: where (n, m), and the grey (n, m) over its background."""
    grey = _grey(image, upright, lines, u)
    left, right = (cv2.blur(_median_of_four(part)[:, None], (1, 15))
                   for part in (grey[:, :4], grey[:, -4:]))
    ramp = np.linspace(0.0, 1.0, grey.shape[1])
    return u.astype(np.float64), grey - left * (1.0 - ramp) - right * ramp


def _median_of_four(values: Array) -> Array:
    """Give the median of each row (n, 4): as `np.median`, at a fraction of its cost."""
    ordered = np.sort(values, axis=1)
    return np.asarray((ordered[:, 1] + ordered[:, 2]) / 2.0)
