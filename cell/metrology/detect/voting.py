"""Where round edges may be: every edge pixel votes for the centres that it could belong to.

An edge pixel at p with gradient g votes at p -+ r g/|g| for every radius r that is expected: votes
of one circle meet at its centre, while those of scratches, glints, grains and a dark arc scatter.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.arrays import Grey, Indices
from cell.metrology.spread import quantile

VOTING_RADIUS = 10.0  # px that the smallest radius keeps at least in the reduced image
EDGE_SHARE = 0.15     # of the pixels vote, those of the largest gradient
SPREAD = 0.07         # of the radius, within which votes of a tilted circle meet


@dataclass(frozen=True)
class Circle:
    """A place that edges voted for, in pixels. `inside` is -1 where the hole is darker, else +1.

    `votes` is about 1 for a complete circle of strong edges.
    """

    x: float
    y: float
    radius: float
    inside: int
    votes: float


def vote_for_circles(image: Image, radii: Array, inside: int, count: int = 5) -> list[Circle]:
    """Find the `count` places that most edges vote for, best first.

    Args:
        image: the region to search.
        radii: expected radii in px, smallest first.
        inside: -1 for holes darker than the metal, +1 for brighter ones.
        count: how many places to return.
    """
    small, factor = _reduced(image, radii[0])
    ballots = _ballots(small)
    layers = np.stack([_layer(ballots, r / factor, inside, small.shape) for r in radii])
    rows, columns = _peaks(layers.max(axis=0), radii[0] / factor, count)
    which = layers[:, rows, columns].argmax(axis=0)
    return [Circle(float((x + 0.5) * factor - 0.5), float((y + 0.5) * factor - 0.5),
                   float(radii[layer]), inside, float(layers[layer, y, x]))
            for layer, y, x in zip(which, rows, columns, strict=True)]


def _reduced(image: Image, radius: float) -> tuple[Image, int]:
    """Halve an image as often as a radius allows: the image, and its pixel in pixels of before."""
    factor = 1
    while radius >= 2 * factor * VOTING_RADIUS and min(image.shape) > 1:
        whole = image[:image.shape[0] // 2 * 2, :image.shape[1] // 2 * 2]
        image = cv2.resize(whole, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        factor *= 2
    return image, factor


def _ballots(small: Image) -> tuple[Indices, Indices, Grey, Grey, Grey]:
    """Give position, unit gradient and weight of the pixels that vote."""
    smooth = cv2.GaussianBlur(small, (0, 0), 0.8).astype(np.float32)
    g_x, g_y = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    size = cv2.magnitude(g_x, g_y)
    some = size[::2, ::2].ravel()
    usual, strong = (quantile(some, 1.0 - share) for share in (EDGE_SHARE, EDGE_SHARE / 5.0))
    y, x = np.nonzero(size > max(usual, 1e-3))
    length = size[y, x]
    weight = np.minimum(length / max(strong, 1e-3), 1.0)
    return x, y, g_x[y, x] / length, g_y[y, x] / length, weight


def _layer(ballots: tuple[Indices, Indices, Grey, Grey, Grey], radius: float, inside: int,
           shape: tuple[int, ...]) -> Grey:
    """Collect the votes for one radius (reduced px), smoothed, per length of the circle."""
    x, y, u, v, weight = ballots
    column = np.rint(x + inside * radius * u).astype(np.intp)
    row = np.rint(y + inside * radius * v).astype(np.intp)
    hit = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    votes = np.bincount(row[hit] * shape[1] + column[hit], weight[hit], shape[0] * shape[1])
    sigma = max(1.0, SPREAD * radius)
    gathered = cv2.GaussianBlur(votes.reshape(shape).astype(np.float32), (0, 0), sigma)
    return gathered * (2.0 * np.pi * sigma**2 / (2.0 * np.pi * radius))


def _peaks(votes: Grey, radius: float, count: int) -> tuple[Indices, Indices]:
    width = 2 * int(max(2.0, 0.5 * radius)) + 1
    summits = votes >= cv2.dilate(votes, np.ones((width, width), np.uint8))
    rows, columns = np.nonzero(summits & (votes > 0.0))
    order = np.argsort(-votes[rows, columns])[:count]
    return rows[order], columns[order]
