"""When an opening is no measurable hole, and which reason to give.

Gates compare a picture with itself (grey of hole and metal, share of the rim), so that they hold
for any camera, light and surface.
"""

from __future__ import annotations

import numpy as np

from cell.core.observation import Image
from cell.metrology.arrays import Mask
from cell.metrology.band import Band, sample_band, spread
from cell.metrology.edges import find_edges
from cell.metrology.ellipse import Ellipse
from cell.metrology.find_holes import MARGIN, RAYS, Hole
from cell.metrology.reasons import Reason, refusal

COMPLETE = 0.75  # of the rim has to be seen
BESIDE = 0.1     # of the radius, inside and outside the rim, where hole and metal are looked at


def check_inside(image: Image, rim: Ellipse) -> None:
    """Refuse a hole that reaches beyond the image."""
    height, width = image.shape
    around = rim.points(np.linspace(0.0, 2.0 * np.pi, 64))
    if (around < 1.0).any() or (around > [width - 2.0, height - 2.0]).any():
        raise refusal("hole_cut_by_border")


def check_whole(hole: Hole) -> None:
    """Refuse a rim of which too little is seen, with the reason that fits."""
    radius = hole.ellipse.radius
    offsets = spread(MARGIN * radius, max(0.5, radius / 60.0))
    band = sample_band(hole.patch, hole.ellipse, offsets, RAYS)
    edges = find_edges(band, hole.inside, 0.4 * hole.contrast)
    seen = edges[np.abs(edges.offset) < max(2.0, 0.03 * radius)].rays(RAYS)
    if seen.mean() < COMPLETE:
        raise refusal(_why_incomplete(band, seen, radius),
                      f"{seen.mean():.0%} of the rim follows an ellipse")


def _why_incomplete(band: Band, seen: Mask, radius: float) -> Reason:
    """Judge a rim by the profiles on which its edge is missing: either the hole goes on beyond it
    (a slot), or metal lies inside it (something covers the hole).
    """
    inner, outer = band.levels(BESIDE * radius)
    hole, metal = float(np.median(inner[seen])), float(np.median(outer[seen]))
    middle, sign = (hole + metal) / 2.0, np.sign(metal - hole)
    goes_on = (sign * (outer[~seen] - middle) < 0.0).mean()
    covered = (sign * (inner[~seen] - middle) > 0.0).mean()
    if max(goes_on, covered) < 0.3:
        return "not_round"
    return "slot" if goes_on > covered else "half_occluded"
