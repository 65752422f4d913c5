"""When an opening is no measurable hole, and which reason to give.

Gates compare a picture with itself (grey of hole and metal, share of the rim), so that they hold
for any camera, light and surface.
"""

from __future__ import annotations

import numpy as np

from cell.metrology.arrays import Mask
from cell.metrology.edges import Band
from cell.metrology.reasons import Reason

COMPLETE = 0.75  # of the rim has to be seen
BESIDE = 0.1     # of the radius, inside and outside the rim, where hole and metal are looked at


def judge_rim(band: Band, seen: Mask, radius: float) -> Reason | None:
    """Judge a rim by the profiles on which its edge was `seen` (n,) bool; None if complete.

    Where the edge is missing, either the hole goes on beyond the rim (a slot), or metal lies
    inside it (something covers the hole).
    """
    if seen.mean() >= COMPLETE or not seen.any():
        return None
    inner = band.grey[:, band.offsets < -BESIDE * radius].mean(axis=1)
    outer = band.grey[:, band.offsets > BESIDE * radius].mean(axis=1)
    hole, metal = float(np.median(inner[seen])), float(np.median(outer[seen]))
    middle, sign = (hole + metal) / 2.0, np.sign(metal - hole)
    goes_on = (sign * (outer[~seen] - middle) < 0.0).mean()
    covered = (sign * (inner[~seen] - middle) > 0.0).mean()
    if max(goes_on, covered) < 0.3:
        return "not_round"
    return "slot" if goes_on > covered else "half_occluded"
