"""Where holes are in the ring-light picture, roughly: places that edges vote for, looked at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.arrays import Mask
from cell.metrology.detect.band import Patch, sample_band, smooth_around, spread
from cell.metrology.detect.edges import FAINTEST, find_edges
from cell.metrology.detect.ellipse import Ellipse, project_circle
from cell.metrology.detect.rim_fit import agree
from cell.metrology.detect.voting import Circle, vote_for_circles
from cell.metrology.features import Expected
from cell.metrology.spread import middle

SMALLEST_RADIUS = 14.0  # px, of a hole that nothing is known of
RAYS = 120
MARGIN = 0.25           # of the radius, on either side of the rim, that is looked at
LEAST_COVERAGE = 0.4    # of the rim, to be a hole at all
FEW_VOTES = 0.1         # of those for a hole that was found, below which nobody looks
LIT = 0.2               # glow, from which on what is behind may be as bright as the sheet
EDGE_WIDTH = 2.5        # px over which the step of a sharp edge extends


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole as the search knows it: a rough `ellipse`, `inside` (-1 darker, +1 brighter than the
    metal; 0 this here and that there, or a dark ring of wall before something as bright), the share
    of its rim that was seen (`coverage`), the `contrast` there (grey/px), the `glow` (the grey
    inside as a share of the metal's) and the `patch` of the image around it.
    """

    ellipse: Ellipse
    inside: int
    coverage: float
    contrast: float
    glow: float
    patch: Patch

    @property
    def lit(self) -> bool:
        """Whether it may be as bright behind as on the sheet, here and there."""
        return self.inside == 0 or (self.inside < 0 and self.glow > LIT)


def find_holes(image: Image, camera: CameraModel, expected: Expected) -> Iterator[Hole]:
    """Find the holes of an image one after the other: the darker ones, then the brighter ones,
    those with the most votes first.
    """
    left, top, right, bottom = _region(camera, expected)
    part = image[top:bottom, left:right]
    octaves, most = _octaves(camera, expected, min(part.shape)), 0.0
    for inside in (-1, +1):
        circles = [circle for radii in octaves for circle in vote_for_circles(part, radii, inside)]
        for circle in sorted(circles, key=lambda circle: -circle.votes):
            if circle.votes < FEW_VOTES * most:
                break
            placed = replace(circle, x=circle.x + left, y=circle.y + top)
            hole = _look(image, placed, expected, camera)
            if hole is not None:
                most = max(most, circle.votes)
                yield hole


def _region(camera: CameraModel, expected: Expected) -> tuple[int, int, int, int]:
    """Give the part of the image to search: left, top, right, bottom."""
    width, height = camera.image_size
    if expected.centre is None:
        return 0, 0, width, height
    x, y = camera.project(expected.centre)
    reach = 3.0 * expected.centre_sigma + 1.5 * (expected.radius or 15.0)
    reach = reach * camera.matrix[0, 0] / float(expected.centre[2]) + 16.0
    left, top = int(np.clip(x - reach, 0, width - 2)), int(np.clip(y - reach, 0, height - 2))
    return (left, top, int(np.clip(x + reach, left + 2, width)),
            int(np.clip(y + reach, top + 2, height)))


def _octaves(camera: CameraModel, expected: Expected, size: int) -> list[Array]:
    """Give the radii to look for, px: a few around the expected one, or octaves of all."""
    if expected.radius is not None and expected.centre is not None:
        radius = expected.radius * camera.matrix[0, 0] / float(expected.centre[2])
        return [radius * np.array([0.95, 1.0, 1.05])]
    starts = SMALLEST_RADIUS * 2.0 ** np.arange(12)
    return [start * 2.0 ** np.arange(0.0, 1.0, 1.0 / 6.0) for start in starts if 2 * start < size]


def _look(image: Image, circle: Circle, expected: Expected, camera: CameraModel) -> Hole | None:
    """Look closer at a place that was voted for; None where it is no hole."""
    start = expected_ellipse(circle, camera, expected)
    patch = smooth_around(image, start, 2.0 * MARGIN * circle.radius)
    step = max(0.5, circle.radius / 60.0)
    band = sample_band(patch, start, spread(MARGIN * circle.radius, step), RAYS)
    steepest = middle((-circle.inside * band.slope).max(axis=1))
    edges = find_edges(band, circle.inside, max(FAINTEST[circle.inside] * steepest, 1e-3))
    if len(edges.ray) < LEAST_COVERAGE * RAYS:
        return None
    ellipse, close = agree(band, edges, max(1.0, 0.02 * circle.radius),
                           free=3 if expected.normal is not None else 5)
    seen = edges[close].rays(RAYS)
    if seen.mean() < LEAST_COVERAGE or not 0.6 < ellipse.radius / circle.radius < 1.6:
        return None
    contrast = middle(edges.strength[close])
    inner, outer = band.levels(0.3 * MARGIN * circle.radius)
    rise = middle(circle.inside * (inner - outer)[seen])
    if rise < 0.3 * EDGE_WIDTH * contrast:  # a line, not a step: scratch, groove, glint
        return None
    glow = middle(inner[seen]) / max(middle(outer[seen]), 1e-3)
    return Hole(ellipse, circle.inside, float(seen.mean()), contrast, glow, patch)


def within(image: Image, ellipse: Ellipse, rays: int) -> Mask:
    """Tell which of `rays` points on an ellipse lie within the image, and not on its border."""
    rim = ellipse.points(np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False))
    last = np.array(image.shape[::-1]) - 2.0
    return np.asarray(((rim >= 1.0) & (rim <= last)).all(axis=1))


def expected_ellipse(circle: Circle, camera: CameraModel, expected: Expected) -> Ellipse:
    """Give a circle the shape that its expected normal makes it appear in."""
    if expected.normal is None:
        return Ellipse.circle(circle.x, circle.y, circle.radius)
    ray = camera.rays([circle.x, circle.y])
    tilted = project_circle(camera, ray, expected.normal, circle.radius / camera.matrix[0, 0])
    return Ellipse(np.array([circle.x, circle.y]), tilted.shape * circle.radius / tilted.radius)
