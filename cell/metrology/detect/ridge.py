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
from cell.metrology.spread import middle

BIN, PAIR = 4, 2       # px along and across the stripe that are averaged before the search
NARROW, WIDE = 2.0, 8.0  # px, the scales that a ridge stands out between
COARSE = 2             # pairs that the ground is averaged over first
MOST = 2               # ridges
DRAWS = 300
TOLERANCE = 2.5        # px, lens distortion over the length included
SIGNIFICANCE = 6.0     # of a ridge above the image's own unrest
PRESENT = 0.35          # of its usual height, to be seen on a line
LEAST_SHARE = 0.15     # of the lines must carry the stripe
BESIDE = 12            # px to either side, where a ridge's ground is looked at
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
    turned = image if upright else cv2.transpose(image)
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


def shows_in(ridge: Ridge, image: Image) -> float:
    """Say how high a ridge stands in another image: grey, as a share of its ground there."""
    turned = image if ridge.upright else np.ascontiguousarray(image.T)
    height = _along(_response(turned), ridge.offset, ridge.slope)[ridge.strength >= PRESENT]
    return float(np.median(height)) / ground_along(ridge, image)


def ground_along(ridge: Ridge, image: Image) -> float:
    """Give the usual grey beside a ridge, at least one."""
    v = np.flatnonzero(~ridge.gone)
    turned = image if ridge.upright else image.T
    u = np.rint(ridge.across(v.astype(np.float64))).astype(np.intp)
    beside = np.clip(np.stack([u - BESIDE, u + BESIDE]), 0, turned.shape[1] - 1)
    return max(float(np.median(turned[v, beside])), 1.0)


def _longest(response: Grey, u: Array, line: Array, height: Array) -> tuple[Mask, Ridge]:
    """Fit the line that most candidates lie on: which ones, and the ridge along it."""
    v = line * BIN + (BIN - 1) / 2.0
    near = _straightest(u, v)
    if near.sum() < 2:
        return near, Ridge(0.0, 0.0, True, 0.0, 0.0, np.zeros(0))
    slope, offset = map(float, np.polyfit(v[near], u[near], 1))
    usual = middle(height[near])
    share = len(np.unique(line[near])) / len(response)
    return near, Ridge(offset, slope, True, share, usual, _along(response, offset, slope) / usual)


def _response(turned: Image) -> Grey:
    """Give how far each bin, BIN lines high and PAIR pixels wide, stands out of its ground."""
    length, width = turned.shape[0] // BIN, turned.shape[1] // PAIR
    whole = turned[:BIN * length, :PAIR * width]
    half = cv2.resize(whole, (width, 2 * length), interpolation=cv2.INTER_AREA)
    binned = cv2.addWeighted(half[::2], 0.5, half[1::2], 0.5, 0.0, dtype=cv2.CV_32F)
    lines = cv2.GaussianBlur(binned, (0, 0), sigmaX=NARROW / PAIR, sigmaY=0.8)
    coarse = cv2.resize(lines, (width // COARSE, length), interpolation=cv2.INTER_AREA)
    ground = cv2.GaussianBlur(coarse, (15, 1), sigmaX=WIDE / (PAIR * COARSE))
    return lines - cv2.resize(ground, (width, length), interpolation=cv2.INTER_LINEAR)


def _along(response: Grey, offset: float, slope: float) -> Array:
    """Give the highest response near the line, for each line of the response."""
    course = offset + slope * (np.arange(len(response)) * BIN + (BIN - 1) / 2.0)
    near = np.rint((course - (PAIR - 1) / 2.0) / PAIR).astype(np.intp)[:, None] + np.arange(-1, 2)
    inside = np.clip(near, 0, response.shape[1] - 1)
    highest = np.take_along_axis(response, inside, axis=1).max(axis=1).astype(np.float64)
    return np.where((near[:, 1] >= 0) & (near[:, 1] < response.shape[1]), highest, 0.0)


def _candidates(response: Grey) -> tuple[Array, Array, Array]:
    """Give the two highest ridges of each line that stand out: u, line and height."""
    unrest = 1.4826 * middle(np.abs(response[::4, ::2]).ravel()) + 0.05
    line, reach = np.arange(len(response)), int(WIDE) // PAIR
    first = response.argmax(axis=1)
    beside = np.clip(first[:, None] + np.arange(-reach, reach + 1), 0, response.shape[1] - 1)
    rest = response.copy()
    np.put_along_axis(rest, beside, 0.0, axis=1)
    column, line = np.concatenate([first, rest.argmax(axis=1)]), np.concatenate([line, line])
    height = response[line, column].astype(np.float64)
    real = height > SIGNIFICANCE * unrest
    return PAIR * column[real] + (PAIR - 1) / 2.0, line[real].astype(np.float64), height[real]


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
    square = (offset[:, None] + slope[:, None] * v - u) ** 2
    miss = np.minimum(square, TOLERANCE**2).sum(axis=1) + np.where(np.abs(slope) < 1.0, 0.0, np.inf)
    return np.asarray(square[int(np.argmin(miss))] < TOLERANCE**2)
