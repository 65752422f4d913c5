"""When an opening is no measurable hole, and which reason to give.

Gates compare a picture with itself (grey of hole and metal, share of the rim), so that they hold
for any camera, light and surface.
"""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.arrays import Mask
from cell.metrology.detect.band import Band, sample_band, spread
from cell.metrology.detect.edges import FAINTEST, find_edges
from cell.metrology.detect.ellipse import Ellipse
from cell.metrology.detect.find_holes import MARGIN, RAYS, Hole, within
from cell.metrology.detect.opening import LEAST_GAP, UNLIKE
from cell.metrology.detect.ridge import Ridge
from cell.metrology.reasons import Reason, refusal
from cell.metrology.spread import middle, quantile

COMPLETE = 0.75  # of the rim has to be seen
DARK, WHITE = 20.0, 254  # grey values of 255
MOSTLY = 0.5     # of the picture
VAGUE = 0.25     # px, to which a profile has to tell the edge
TOO_SOFT = 3.0   # px of blur
FLATTEST = 0.75  # minor over major axis: a tilt of 41 degrees
RAGGED = 0.03    # of the radius, that edges may scatter
CLIPPED = 0.8    # of the rim's sheet is white: the edge lies where the light blooms
FEWEST_RAYS = 0.25  # of the profiles round a rim have to fit
HALF = 0.5       # of the profiles of a rim before something lit have to fit
COVERED = 0.2    # of a rim, that metal inside it hides
NEARBY = 0.5     # of the radius: where the rest of a rim lies that a small ellipse was fitted to
BORDERING = 0.25  # of what is missing of a rim would lie beyond the image
BESIDE = 0.1     # of the radius, inside and outside the rim, where hole and metal are looked at


def check_lit(image: Image) -> None:
    """Refuse a picture in which even the brightest parts are dark."""
    brightest = quantile(image[::8, ::8].ravel(), 0.99)
    if brightest < DARK:
        raise refusal("too_dark", f"99 % of it lies below {brightest:.0f} of 255")


def check_inside(image: Image, rim: Ellipse) -> None:
    """Refuse a hole that reaches beyond the image."""
    if not within(image, rim, RAYS).all():
        raise refusal("hole_cut_by_border")


def check_whole(image: Image, hole: Hole) -> None:
    """Refuse a rim of which too little is seen, with the reason that fits."""
    radius = hole.ellipse.radius
    offsets = spread(MARGIN * radius, max(0.5, radius / 60.0))
    band = sample_band(hole.patch, hole.ellipse, offsets, RAYS)
    edges = find_edges(band, hole.inside, FAINTEST[hole.inside] * hole.contrast)
    seen = edges[np.abs(edges.offset) < max(2.0, 0.03 * radius)].rays(RAYS)
    if seen[within(image, hole.ellipse, RAYS)].mean() < COMPLETE:
        if _reaches_border(image, hole, band)[~seen].mean() > BORDERING:
            raise refusal("hole_cut_by_border")
        raise refusal(_why_incomplete(band, seen, radius),
                      f"{seen.mean():.0%} of the rim follows an ellipse")


def _reaches_border(image: Image, hole: Hole, band: Band) -> Mask:
    """Tell on which profiles (n,) a larger ellipse leaves the image where that shows the hole."""
    points = hole.ellipse.scaled(1.0 + NEARBY).points(band.t)
    nearest = np.clip(np.rint(points), 0, np.array(image.shape[::-1]) - 1).astype(np.intp)
    inner, outer = (float(np.median(level)) for level in band.levels(BESIDE * hole.ellipse.radius))
    border = image[nearest[:, 1], nearest[:, 0]] - (inner + outer) / 2.0
    return (np.abs(points - nearest).max(axis=1) > 1.0) & (border * hole.inside > 0.0)


def check_clear(unsure: float, blur: float) -> None:
    """Refuse a rim that its profiles tell too vaguely (`unsure`, px), for what they leave
    unexplained is too high beside their steps, or that is too soft (`blur`, px).
    """
    if blur > TOO_SOFT:
        raise refusal("blurred", f"the edge is {blur:.1f} px wide")
    if unsure > VAGUE:
        raise refusal("too_dark", f"a profile tells the edge to {unsure:.1f} px")


def check_settled(good: Mask, *, lit: bool) -> None:
    """Refuse a rim that too few of its profiles (n,) fit: hardly any of them, or before something
    lit, which another ellipse may cross, not half of them.
    """
    if good.mean() < (HALF if lit else FEWEST_RAYS):
        raise refusal("too_dark" if lit else "not_round",
                      f"{good.mean():.0%} of the profiles across its edge fit")


def check_uncovered(hole: Hole, ellipse: Ellipse, sure: Mask) -> None:
    """Refuse an ellipse that metal lies within where its edge is not `sure` (n,), though elsewhere
    inside and outside are not alike.
    """
    radius = ellipse.radius
    band = sample_band(hole.patch, ellipse, spread(MARGIN * radius, 1.0), len(sure))
    near = band.grey[:, np.abs(band.offsets / radius + BESIDE / 2.0) < BESIDE / 4.0].mean(axis=1)
    inner, outer = band.levels(BESIDE * radius)
    usual = middle(np.abs(outer - near)[sure])
    alike = np.maximum(np.abs(outer - near), np.abs(outer - inner)) < usual / 2.0
    covered = float((~sure & alike).mean())
    if usual > UNLIKE * max(middle(near[sure]), middle(outer[sure])) and covered > COVERED:
        raise refusal("half_occluded", f"metal covers {covered:.0%} of the rim")


def check_unclipped(grey: Array) -> None:
    """Refuse a rim whose sheet is white nearly all round, from its profiles (n, m)."""
    share = float(clipped(grey).mean())
    if share > CLIPPED:
        raise refusal("saturated", f"{share:.0%} of the rim borders on white")


def clipped(grey: Array) -> Mask:
    """Tell on which profiles (n, m) the sheet is white, as bright as a picture can show."""
    return np.asarray(grey[:, -1] >= WHITE)


def check_round(ellipse: Ellipse, spread_of_edges: float) -> None:
    """Refuse an opening that is no circle seen from the front."""
    major, minor, _ = ellipse.axes
    if minor < FLATTEST * major:
        raise refusal("slot", f"its axes are {major:.0f} and {minor:.0f} px")
    if spread_of_edges > RAGGED * ellipse.radius:
        raise refusal("not_round", f"its edge scatters by {spread_of_edges:.1f} px")


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


def is_white(image: Image) -> bool:
    """Tell whether most of a picture is white, so that an opening may not show."""
    return bool((image >= WHITE).mean() > MOSTLY)


def why_no_hole(image: Image, ridge: Ridge) -> Reason:
    """Say why a picture shows no round hole where the stripe passes: nothing at all, too much
    light, or an opening of another shape.
    """
    if is_white(image):
        return "saturated"
    x, y = np.clip(np.rint(ridge.points(ridge.length)), 0, np.array(image.shape)[::-1] - 1).T
    grey = image[y.astype(int), x.astype(int)].astype(np.float64)
    gone = ridge.gone
    if gone.sum() < LEAST_GAP or gone.all():
        return "no_hole"
    there, opening = float(np.median(grey[~gone])), float(np.median(grey[gone]))
    if abs(there - opening) < UNLIKE * max(there, opening):
        return "no_hole"
    return "hole_cut_by_border" if gone[0] or gone[-1] else "not_round"
