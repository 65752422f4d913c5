"""The rim of a hole before something lit: no darker than the sheet as a whole, nor brighter.

What is behind may be as bright as the sheet, here brighter and there darker, with soft shadows of
the sheet and bright spots inside the rim that look like a smaller hole. The rim itself is sharp
all round: a dark ring of wall, or a step either way. And the stripe tells two of its points: it
leaves the sheet at one and comes back at the other.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.detect.band import sample_band, smooth_around, spread
from cell.metrology.detect.edges import FAINTEST, Edges, find_edges, rise
from cell.metrology.detect.find_holes import MARGIN, RAYS, Hole, expected_ellipse
from cell.metrology.detect.rim_fit import agree_between
from cell.metrology.detect.voting import Circle
from cell.metrology.features import Expected
from cell.metrology.spread import middle

PASSING = np.arange(-1.5, 1.51, 0.25)  # half gaps, that a stripe may pass a centre by
SLACK = 5.0             # px, to which a gap of the stripe tells the rim
STEP = 0.75             # px: a ring of wall is narrow
STANDS_OUT = 0.5        # of the rim is seen, more than texture would show by chance
BESIDE = (-9, -7, -5, -3, 3, 5, 7, 9)  # tolerances beside a rim, where texture alone is met


def find_lit_rim(image: Image, ends: Array, camera: CameraModel, expected: Expected) -> Hole | None:
    """Find the rim that the stripe meets at two `ends` (2, 2) px; None where nothing stands out."""
    looks = [_look(image, circle, ends, camera, expected)
             for circle in _circles(ends, camera, expected)]
    return max((hole for hole in looks if hole is not None), default=None,
               key=lambda hole: hole.coverage * hole.contrast**0.5)


def _circles(ends: Array, camera: CameraModel, expected: Expected) -> Iterator[Circle]:
    """Give circles through the ends of a gap: two of the expected radius, or some of any."""
    half = (ends[1] - ends[0]) / 2.0
    length = float(np.hypot(*half))
    passing = PASSING
    if expected.radius is not None and expected.centre is not None:
        radius = expected.radius * float(camera.matrix[0, 0]) / float(expected.centre[2])
        if length > (1.0 + MARGIN) * radius:
            return  # a hole of another size
        aside = np.sqrt(max((radius / length) ** 2 - 1.0, 0.0))
        passing = np.array([-aside, aside])
    for share in passing:
        x, y = ends.mean(axis=0) + share * np.array([-half[1], half[0]])
        yield Circle(float(x), float(y), length * float(np.hypot(1.0, share)), 0, 0.0)


def _look(image: Image, circle: Circle, ends: Array, camera: CameraModel,
          expected: Expected) -> Hole | None:
    start = expected_ellipse(circle, camera, expected)
    patch = smooth_around(image, start, 2.0 * MARGIN * circle.radius)
    band = sample_band(patch, start, spread(MARGIN * circle.radius, STEP), RAYS)
    edges = find_edges(band, 0, max(FAINTEST[0] * middle(rise(band, 0).max(axis=1)), 1e-3))
    if len(edges.ray) < RAYS * STANDS_OUT:
        return None
    width = max(1.0, 0.02 * circle.radius)
    ellipse, miss = agree_between(band, edges, width, ends, SLACK)
    if not _stands_out(edges, miss / width):
        return None
    close = np.abs(miss) < width
    seen = edges[close].rays(RAYS)
    inner, outer = band.levels(0.3 * MARGIN * circle.radius)
    glow = middle(inner[seen]) / max(middle(outer[seen]), 1e-3)
    return Hole(ellipse, 0, float(seen.mean()), middle(edges.strength[close]), glow, patch)


def _stands_out(edges: Edges, miss: Array) -> bool:
    """Tell whether edges follow an ellipse, which they `miss` (k,) by so many tolerances, more than
    they follow others beside it, as those of a texture do.
    """
    follow = [edges[np.abs(miss - k) < 1.0].rays(RAYS).mean() for k in (0, *BESIDE)]
    chance = float(np.mean(follow[1:]))
    return bool(follow[0] - chance > STANDS_OUT * (1.0 - chance))
