"""Find the rim of a hole in the ring-light picture, to a fraction of a pixel."""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.arrays import Grey
from cell.metrology.edges import Band, Edges, find_edges, sample_band, smooth_around
from cell.metrology.ellipse import Ellipse
from cell.metrology.features import Expected, Rim
from cell.metrology.find_holes import Hole, find_holes
from cell.metrology.gates import judge_rim
from cell.metrology.reasons import refusal
from cell.metrology.rim_fit import agree, settle

WIDE, NARROW = 8.0, 5.0  # px on either side of the rim that are looked at, first and last


def detect_hole(image: Image, camera: CameraModel, expected: Expected) -> Rim:
    """Find the most complete hole of a ring-light image and its rim.

    Raises:
        UnmeasurableError: there is none, or it is cut by the border, covered or not round.
    """
    holes = find_holes(image, camera, expected)
    if not holes:
        raise refusal("no_hole")
    return detect_rim(image, holes[0])


def detect_rim(image: Image, hole: Hole) -> Rim:
    """Locate the rim of a hole that was found."""
    _check_inside(image, hole.ellipse)
    smooth = smooth_around(image, hole.ellipse, 0.25 * hole.ellipse.radius + 16.0)
    _check_whole(smooth, hole)
    rough = _fit(sample_rim(smooth, hole.ellipse, WIDE), hole, tolerance=3.0)[0]
    band = sample_rim(smooth, rough, NARROW)
    ellipse, edges, miss, scale = _fit(band, hole, tolerance=1.0)
    good = np.abs(miss) < 3.0 * scale
    t, normals = band.t[edges.ray], band.ellipse.normals(band.t[edges.ray])
    points = band.ellipse.points(t) + edges.offset[:, None] * normals
    x, y = map(float, ellipse.centre)
    return Rim(points[good], -normals[good], scale, 4.0, (x, y, *ellipse.axes),
               quality={"coverage": hole.coverage, "contrast": hole.contrast,
                        "inside": float(hole.inside)})


def sample_rim(smooth: Grey, ellipse: Ellipse, half_width: float) -> Band:
    """Sample a profile for each pixel of the rim."""
    rays = int(np.clip(2.0 * np.pi * ellipse.radius, 90, 720))
    return sample_band(smooth, ellipse, half_width, rays=rays)


def _fit(band: Band, hole: Hole, tolerance: float) -> tuple[Ellipse, Edges, Array, float]:
    """Fit the edges that agree: the ellipse, those edges, their residuals and spread (px)."""
    edges = find_edges(band, hole.inside, 0.3 * hole.contrast)
    _, close = agree(band, edges, tolerance)
    agreed = edges[close]
    ellipse, miss, scale = settle(band, agreed, floor=0.02)
    return ellipse, agreed, miss, scale


def _check_inside(image: Image, ellipse: Ellipse) -> None:
    height, width = image.shape
    rim = ellipse.points(np.linspace(0.0, 2.0 * np.pi, 64))
    if (rim < 1.0).any() or (rim > [width - 2.0, height - 2.0]).any():
        raise refusal("hole_cut_by_border")


def _check_whole(smooth: Grey, hole: Hole) -> None:
    radius = hole.ellipse.radius
    band = sample_band(smooth, hole.ellipse, 0.22 * radius, rays=180)
    edges = find_edges(band, hole.inside, 0.4 * hole.contrast)
    seen = np.isin(np.arange(len(band.t)), edges.ray[np.abs(edges.offset) < 2.0])
    reason = judge_rim(band, seen, radius)
    if reason is not None:
        raise refusal(reason, f"{seen.mean():.0%} of the rim follows an ellipse")
