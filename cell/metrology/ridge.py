"""The laser stripe as a whole: a thin bright ridge along a straight line.

A stripe may run along the rows or the columns of the image. It is always looked at with its length
downwards: `u` runs across it, `v` along it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from cell.core.geometry import Array, Plane
from cell.core.observation import Image
from cell.metrology.arrays import Grey, Mask

BIN = 4                # lines along the stripe that are averaged before the search
NARROW, WIDE = 2.0, 8.0  # px, the scales that a ridge stands out between
COARSE = 4             # px across, that the ground is averaged over first
MOST = 2               # ridges
DRAWS = 300
TOLERANCE = 2.5        # px, lens distortion over the length included
SIGNIFICANCE = 6.0     # of a ridge above the image's own unrest
PRESENT = 0.35          # of its usual height, to be seen on a line
LEAST_SHARE = 0.15     # of the lines must carry the stripe
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class Ridge:
    """A straight stripe: across it at `v`, it lies at `offset + slope v`, px.

    `upright` says whether the stripe runs along the columns (u is x); `share` how much of the
    image's length it covers, `height` its typical height in grey over its surroundings. `strength`
    is the height along it, one for BIN lines, as a share of the typical one.
    """

    offset: float
    slope: float
    upright: bool
    share: float
    height: float
    strength: Array

    def across(self, v: Array) -> Array:
        """Say where the stripe lies across its length, at each v."""
        return self.offset + self.slope * v

    @property
    def length(self) -> int:
        """How many lines of the image lie along the stripe, but for a rest below BIN."""
        return BIN * len(self.strength)

    @property
    def gone(self) -> Mask:
        """Tell on which of the image's lines (length,) the stripe is missing."""
        return np.repeat(self.strength < PRESENT, BIN)

    def points(self, length: int) -> Array:
        """Give pixels (length, 2), x and y, one for each line along the stripe."""
        v = np.arange(length, dtype=np.float64)
        return self.pixels(self.across(v), v)

    def pixels(self, u: Array, v: Array) -> Array:
        """Turn across and along into pixels (n, 2), x and y."""
        return np.column_stack([u, v] if self.upright else [v, u])


def runs_upright(light_plane: Plane) -> bool:
    """Tell whether the stripe of a light plane runs along the image's columns."""
    return abs(float(light_plane.normal[0])) >= abs(float(light_plane.normal[1]))


def find_ridges(image: Image, *, upright: bool) -> list[Ridge]:
    """Find the straight ridges of an image, at most MOST, the longest first.

    Behind a large hole a second sheet may show more of the laser than the first.
    """
    turned = image if upright else np.ascontiguousarray(image.T)
    response = _response(turned)
    u, line, height = _candidates(response)
    found: list[Ridge] = []
    while len(found) < MOST and len(u) > 1:
        near, ridge = _longest(response, u, line, height)
        if ridge.share < LEAST_SHARE or (found and ridge.height < PRESENT * found[0].height):
            break
        found.append(replace(ridge, upright=upright))
        u, line, height = u[~near], line[~near], height[~near]
    return found


def _longest(response: Grey, u: Array, line: Array, height: Array) -> tuple[Mask, Ridge]:
    """Fit the line that most candidates lie on: which ones, and the ridge along it."""
    v = line * BIN + (BIN - 1) / 2.0
    near = _straightest(u, v)
    if near.sum() < 2:
        return near, Ridge(0.0, 0.0, True, 0.0, 0.0, np.zeros(0))
    slope, offset = map(float, np.polyfit(v[near], u[near], 1))
    usual = float(np.median(height[near]))
    share = len(np.unique(line[near])) / len(response)
    return near, Ridge(offset, slope, True, share, usual, _along(response, offset, slope) / usual)


def _response(turned: Image) -> Grey:
    length, width = turned.shape
    binned = cv2.resize(turned, (width, max(1, length // BIN)), interpolation=cv2.INTER_AREA)
    lines = cv2.GaussianBlur(binned.astype(np.float32), (0, 0), sigmaX=NARROW, sigmaY=0.8)
    coarse = cv2.resize(lines, (max(1, width // COARSE), len(lines)), interpolation=cv2.INTER_AREA)
    ground = cv2.GaussianBlur(coarse, (15, 1), sigmaX=WIDE / COARSE)
    return lines - cv2.resize(ground, (width, len(lines)), interpolation=cv2.INTER_LINEAR)


def _along(response: Grey, offset: float, slope: float) -> Array:
    """Give the highest response near the line, for each line of the response."""
    middle = offset + slope * (np.arange(len(response)) * BIN + (BIN - 1) / 2.0)
    near = np.rint(middle).astype(np.intp)[:, None] + np.arange(-2, 3)
    inside = np.clip(near, 0, response.shape[1] - 1)
    highest = np.take_along_axis(response, inside, axis=1).max(axis=1).astype(np.float64)
    return np.where((near[:, 2] >= 0) & (near[:, 2] < response.shape[1]), highest, 0.0)


def _candidates(response: Grey) -> tuple[Array, Array, Array]:
    """Give the two highest ridges of each line that stand out: u, line and height."""
    unrest = 1.4826 * float(np.median(np.abs(response[::2, ::4]))) + 0.05
    summit = ((response[:, 1:-1] > response[:, :-2]) & (response[:, 1:-1] >= response[:, 2:])
              & (response[:, 1:-1] > SIGNIFICANCE * unrest))
    heights = np.where(summit, response[:, 1:-1], np.float32(0.0))
    line = np.arange(len(response))
    first = heights.argmax(axis=1)
    tops = heights[line, first]
    heights[line, first] = 0.0
    second = heights.argmax(axis=1)
    height = np.concatenate([tops, heights[line, second]]).astype(np.float64)
    column, line = np.concatenate([first, second]), np.concatenate([line, line])
    real = height > 0.0
    return column[real].astype(np.float64) + 1.0, line[real].astype(np.float64), height[real]


def _straightest(u: Array, v: Array) -> Mask:
    """Tell which candidates lie on the line that holds most (RANSAC, evenly spread draws)."""
    draw, count = np.arange(DRAWS), len(u)
    first = np.floor(count * np.mod(draw * GOLDEN, 1.0)).astype(np.intp)
    second = np.floor(count * np.mod(draw * np.sqrt(2.0), 1.0)).astype(np.intp)
    far = np.abs(v[first] - v[second]) > 3 * BIN
    if not far.any():
        return np.zeros(count, dtype=bool)
    first, second = first[far], second[far]
    slope = (u[second] - u[first]) / (v[second] - v[first])
    offset = u[first] - slope * v[first]
    miss = np.abs(offset[:, None] + slope[:, None] * v - u) / TOLERANCE
    agreement = np.clip(1.0 - miss**2, 0.0, None).sum(axis=1) * (np.abs(slope) < 1.0)
    return np.asarray(miss[int(np.argmax(agreement))] < 1.0)
