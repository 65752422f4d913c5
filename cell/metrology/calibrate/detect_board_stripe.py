"""Find the laser stripe on a printed board: the same centres as in measuring, freed of the print.

Ink sends back a tenth of what paper does, so that an edge of the print that crosses the stripe
would pull its centre. The picture under the ring light shows how much each pixel sends back; the
stripe's picture is divided by it, and lines on ink are left out.
"""

from __future__ import annotations

import cv2
import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.detect.ridge import find_ridges
from cell.metrology.detect.stripe_centres import HALF_WINDOW, centre_stripe
from cell.metrology.spread import robust_sigma, tukey_weights

INK = 0.35            # of the paper's brightness; darker lines are left out
CLIPPED = 250         # grey, from which a stripe has lost its summit
REACH = 6             # px across the stripe that must be paper
LEAST_LINES = 30
OUTLIER = 3.5         # standard deviations from the stripe's own smooth line


def detect_board_stripe(stripe: Image, ring: Image, camera: CameraModel, *,
                        upright: bool) -> Array:
    """Locate the stripe on a board: pixels (n, 2), one for each line of the image on paper.

    Args:
        stripe: the picture with the laser on.
        ring: the picture under the ring light, from the same place.
        camera: the camera's lens, under which a stripe on a flat board is straight.
        upright: whether the stripe runs along the image's columns.

    Raises:
        UnmeasurableError: `no_stripe`, `stripe_too_short`.
    """
    paper = _paper(ring)
    flat = _flatten(stripe, paper)
    ridges = find_ridges(flat, upright=upright)
    if not ridges:
        raise UnmeasurableError("no_stripe", "no laser stripe on the board")
    ridge = ridges[0]
    length, width = stripe.shape if upright else stripe.shape[::-1]
    v = np.arange(length, dtype=np.float64)
    u = ridge.across(v)
    v = v[(u > HALF_WINDOW + 1) & (u < width - HALF_WINDOW - 2)]
    lines = v[_on_paper(paper if upright else paper.T, ridge.across(v), v)]
    if len(lines) < LEAST_LINES:
        raise UnmeasurableError("stripe_too_short", f"{len(lines)} lines of stripe on paper")
    across, height = centre_stripe(flat, ridge, lines)
    bright = height > 0.3 * np.median(height)
    pixels = ridge.pixels(across[bright], lines[bright])
    if len(pixels) < LEAST_LINES:
        raise UnmeasurableError("stripe_too_short", f"{len(pixels)} lines of stripe on paper")
    return _straight(pixels, camera, upright)


def _paper(ring: Image) -> Array:
    """How bright (0 to 1) each pixel is against paper nearby, so that ink is dark everywhere."""
    grey = cv2.GaussianBlur(ring, (0, 0), 0.7).astype(np.float64)
    size = max(ring.shape) // 6
    bright = cv2.dilate(ring, np.ones((size, size), np.uint8)).astype(np.float64)
    return np.clip(grey / np.maximum(cv2.blur(bright, (size, size)), 20.0), 0.02, 1.0)


def _flatten(stripe: Image, paper: Array) -> Image:
    """Divide by the print; where that would be noise, on ink, nothing is left."""
    light = np.where(paper > INK, stripe / paper, 0.0)
    return np.clip(light * 0.7, 0, 255).astype(np.uint8)


def _on_paper(paper: Array, u: Array, v: Array) -> Array:
    across = np.rint(u).astype(np.intp)[:, None] + np.arange(-REACH, REACH + 1)
    return np.asarray((paper[v.astype(np.intp)[:, None], across] > INK).all(axis=1))


def _straight(pixels: Array, camera: CameraModel, upright: bool) -> Array:
    """Keep what lies on one straight line once the lens is undone."""
    across, along = camera.normalise(pixels).T[::1 if upright else -1]
    rows = np.column_stack([np.ones_like(along), along])
    miss = across - np.median(across)
    for _ in range(8):
        root = np.sqrt(tukey_weights(miss, max(1e-9, robust_sigma(miss))))
        line = np.linalg.lstsq(rows * root[:, None], across * root, rcond=None)[0]
        miss = across - rows @ line
    return pixels[np.abs(miss) < OUTLIER * max(1e-9, robust_sigma(miss))]
