"""Find the rim of a hole in the ring-light picture, to a fraction of a pixel.

Rough edges by their slope, those that agree on an ellipse, then the grey profiles of these rays:
hole, wall and sheet, with the wall that thickness and tilt predict.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.arrays import Indices, Mask
from cell.metrology.detect.band import SMOOTHING, Band, Patch, sample_band, spread
from cell.metrology.detect.edges import FAINTEST, Edges, find_edges
from cell.metrology.detect.ellipse import Ellipse
from cell.metrology.detect.find_holes import Hole, find_holes
from cell.metrology.detect.gates import (
    COMPLETE,
    check_clear,
    check_inside,
    check_lit,
    check_round,
    check_settled,
    check_unclipped,
    check_uncovered,
    check_whole,
    clipped,
)
from cell.metrology.detect.profile import Profile, compare
from cell.metrology.detect.profile_fit import NARROWEST, fit_profile, locate_edges, uneven_blur
from cell.metrology.detect.rim_fit import agree, settle
from cell.metrology.detect.wall import Wall, is_known, lit, predict_wall, suspect_walls
from cell.metrology.features import Expected, Rim
from cell.metrology.reasons import refusal
from cell.metrology.spread import correlation_length, middle, robust_sigma

WIDE, NEAR = 8.0, 4.0  # px to either side, where edges are looked for first
OUTWARD = 3.0          # px of sheet in a grey profile: more would add its texture
INWARD, BEHIND = 3.0, 2.0  # px of hole beyond the wall; more of it tells how a shadow slopes
AMID, AGAIN = 1.0, 3   # px from the middle of its profiles, that a rim is moved there; times
MANY = 0.87            # profiles an edge, below which two rims may show
NOTICED = 0.7          # px of wall, below which its brightness makes no difference
ROUGH_SPACING, SPACING = 3.0, 1.5  # px along the rim
SHARP, SOFT_DOUBT = 1.0, 6.0  # px of an unknown lens's blur; px of ambiguity by each px beyond
ALIKE, ROUND_DOUBT = 1.05, 20.0  # times a known lens's blur, and the same
SOFTEST = 1.5          # px of ambiguity by softness, at most
LIT_DOUBT, DARK_DOUBT = 0.4, 0.2  # of what a wall draws an edge by: a dark one is like another
BROAD, BROAD_DOUBT = 2.0, 0.3  # px of wall, and what share of the rest is doubted
UNSURE, SURE = 1.0, 4.0  # px, beyond which a profile tells nothing of its edge; of others'
WAVES = np.arange(3, 5)  # crests round a rim: the form of punched and drilled holes
SMALL_ROUGHNESS = 0.25  # px from end to end, which texture alone gives
EVEN, LIP = 0.06, 1.7   # px² that the blur's variance differs by all the same; lips beyond that
CLIPPED_DOUBT = 0.6     # px, where white hides how high the step is


def detect_hole(image: Image, camera: CameraModel, expected: Expected) -> Rim:
    """Find the most complete hole of a ring-light image and its rim.

    Raises:
        UnmeasurableError: there is none, or it is cut by the border, covered or not round.
    """
    check_lit(image)
    holes: list[Hole] = []
    for hole in find_holes(image, camera, expected):
        holes.append(hole)
        if expected.radius is not None and hole.coverage > COMPLETE:
            break  # the size is right and nothing is missing
    if not holes:
        raise refusal("no_hole")
    best = max(holes, key=lambda hole: hole.coverage * hole.contrast**0.5)
    return detect_rim(image, best, camera, expected)


def detect_rim(image: Image, hole: Hole, camera: CameraModel, expected: Expected) -> Rim:
    """Locate the rim of a hole that was found.

    Raises:
        UnmeasurableError: it is cut by the border, covered or not round.
    """
    if hole.inside:  # else it was looked for as a whole
        check_whole(image, hole)
    check_inside(image, hole.ellipse)
    rough, seen, doubled = _rough_rim(hole)
    walls = [predict_wall(rough, hole, camera, expected)]
    known = is_known(expected)
    if doubled and not known:
        walls += suspect_walls(walls[0])
    elif doubled or walls[0].widest > NOTICED:
        walls.append(lit(walls[0], hole))
    band, rays, profile = _fit(hole, rough, seen, walls, doubled or hole.inside >= 0,
                               _sharpest(camera))
    edge, unsure, misfit = locate_edges(band, profile)
    unrest = middle(misfit[rays])
    check_clear(middle(unsure[rays]), profile.blur)
    good = rays & (unsure < UNSURE) & (misfit < 3.0 * unrest) & (np.abs(edge - profile.edge) < 2.0)
    check_settled(good, lit=hole.lit)
    if hole.lit:
        check_uncovered(hole, band.ellipse, good & (unsure < SURE * middle(unsure[good])))
    check_unclipped(band.grey[good])
    rim = _rim(band, edge, good, profile, hole, 0.0 if known else walls[0].sigma)
    doubt = _ambiguity(band, edge, np.flatnonzero(good), profile, camera.blur)
    return replace(rim, ambiguity=rim.ambiguity + doubt)


def _rough_rim(hole: Hole) -> tuple[Ellipse, Mask, bool]:
    """Fit the edges that agree: the ellipse, on which of its profiles they lie (n,), and whether
    many profiles show more than one edge, as they do across a wall.
    """
    rays = _rays(hole.ellipse, ROUGH_SPACING)
    band = sample_band(hole.patch, hole.ellipse, spread(WIDE if hole.inside else NEAR, 0.5), rays)
    edges = find_edges(band, hole.inside, 0.75 * FAINTEST[hole.inside] * hole.contrast)
    agreed = edges[agree(band, edges, tolerance=2.0)[1]]
    ellipse, miss, scale = settle(band, agreed, floor=0.02)
    seen = agreed[np.abs(miss) < max(3.0 * scale, 1.0)].rays(rays)
    return ellipse, seen, edges.rays(rays).sum() < MANY * len(edges.ray)


def _fit(hole: Hole, rough: Ellipse, seen: Mask, walls: list[Wall],
         doubled: bool, sharpest: float) -> tuple[Band, Mask, Profile]:
    """Fit the grey profiles around a rough rim; where either sense was followed, which shows other
    edges than the rim, around what was fitted again until the rim lies amid its profiles. Returns
    them and which of them were used as well.
    """
    widest, more = max(wall.widest for wall in walls), BEHIND if hole.lit else 0.0
    band = _profiles(hole.patch, rough, widest, more)
    rays = np.repeat(seen, -(-len(band.t) // len(seen)))[:len(band.t)]
    profile = fit_profile(band, rays, walls, doubled=doubled, sharpest=sharpest)
    for _ in range(0 if hole.inside else AGAIN):
        if np.abs(profile.edge).max() < AMID:
            break
        move = np.asarray(np.linalg.lstsq(band.design, profile.edge, rcond=None)[0])
        band = _profiles(hole.patch, band.ellipse.moved(move), widest, more)
        rays = np.ones(len(band.t), dtype=bool)
        profile = fit_profile(band, rays, walls, doubled=doubled, sharpest=sharpest)
    return band, rays, profile


def _sharpest(camera: CameraModel) -> float:
    """Say how soft even a sharp rim is in a smoothed picture, px: sharper, a fit is wrong."""
    return NARROWEST if camera.blur is None else float(np.hypot(camera.blur / ALIKE, SMOOTHING))


def _profiles(patch: Patch, rim: Ellipse, wall_width: float, more: float) -> Band:
    shown = np.clip(wall_width, 0.0, 0.3 * rim.radius)
    offsets = np.arange(-np.ceil(INWARD + more + shown), max(OUTWARD, np.ceil(shown + 2.0)) + 0.5)
    return sample_band(patch, rim, offsets, _rays(rim, SPACING))


def _rays(rim: Ellipse, spacing: float) -> int:
    return int(np.clip(2.0 * np.pi * rim.radius / spacing, 90, 400))


def _rim(band: Band, edge: Array, good: Mask, profile: Profile, hole: Hole,
         width_sigma: float) -> Rim:
    ray = np.nonzero(good)[0]
    ellipse, miss, scale = settle(band, Edges(ray, edge[ray], edge[ray]), floor=0.01)
    check_round(ellipse, scale)
    kept = np.abs(miss) < 3.5 * scale
    noise = _without_waves(miss[kept], band.t[ray[kept]])
    normals = band.normals[ray]
    # A blurred disc looks smaller: its half level lies s**2 / 2R inside.
    bend = profile.blur**2 / (2.0 * ellipse.radius)
    points = band.ellipse.points(band.t[ray]) + (edge[ray] + bend)[:, None] * normals
    x, y = map(float, ellipse.centre)
    major, minor, angle = ellipse.axes
    drawn, widened = _drawn(band[ray], replace(profile, edge=edge)[ray], width_sigma)
    return Rim(points[kept], -normals[kept], robust_sigma(noise), correlation_length(noise),
               (x, y, major + bend, minor + bend, angle), ambiguity=widened, drawn=drawn[kept],
               blur=profile.blur, quality=_quality(hole, profile, good, drawn))


def _without_waves(miss: Array, t: Array) -> Array:
    """Take the hole's own waves out of what edges miss an ellipse by, at the angles t (n,): waves
    of more than two crests round a rim move neither its centre nor its size.
    """
    turns = np.outer(t, WAVES)
    waves = np.concatenate([np.cos(turns), np.sin(turns)], axis=1)
    return miss - waves @ np.linalg.lstsq(waves, miss, rcond=None)[0]


def _ambiguity(band: Band, edge: Array, rays: Indices, profile: Profile,
               lens: float | None) -> float:
    """Say how far the visible edge may lie beside the bore's (px): burr and die roll show as a
    ragged edge, one that is softer than the `lens` (px) draws it, or softer here than there; what
    is white may be of any height.
    """
    low, high = np.quantile((edge - profile.edge)[rays], [0.025, 0.975])
    softness = np.sqrt(max(profile.blur**2 - SMOOTHING**2, 0.0))
    rounded = (SOFT_DOUBT * (softness - SHARP) if lens is None
               else ROUND_DOUBT * (softness - ALIKE * lens))
    uneven = uneven_blur(band[rays], replace(profile, edge=edge)[rays])
    ragged = max(high - low - SMALL_ROUGHNESS, LIP * np.sqrt(max(uneven - EVEN, 0.0)))
    white = CLIPPED_DOUBT * float(clipped(band.grey[rays]).mean())
    return float(max(ragged, min(rounded, SOFTEST), 0.0) + white)


def _drawn(band: Band, profile: Profile, width_sigma: float) -> tuple[Array, float]:
    """Say how far (n,) px a wall of another shade than was thought draws each edge; and how far one
    of another width (px) may draw the rim.
    """
    seen = compare(band.offsets, band.grey, profile)
    square = np.maximum(seen.products[:, 0, 0], 1e-9)
    by_width, by_shade = seen.products[:, 0, 2] / square, seen.products[:, 0, 3] / square
    glow = seen.levels[:, 0] / np.maximum(seen.levels[:, 1], 1e-3)
    behind = 1.0 if profile.backlight else glow if profile.sloped else 0.0  # as a wall's shade
    between = profile.backlight | ((profile.shade - behind) * (1.0 - glow) > 0.0)
    doubt = np.where(between, LIT_DOUBT, DARK_DOUBT) * np.abs(profile.shade - behind)
    broad = max(float(profile.width.max()) - BROAD, 0.0) if width_sigma else 0.0
    return (np.minimum(np.abs(by_shade) * doubt, np.maximum(profile.width, 0.0)),
            float(np.abs(by_width).mean()) * width_sigma + BROAD_DOUBT * broad)


def _quality(hole: Hole, profile: Profile, good: Mask, drawn: Array) -> dict[str, float]:
    return {"coverage": float(good.mean()), "contrast": hole.contrast, "inside": float(hole.inside),
            "blur_px": profile.blur, "wall_px": float(profile.width.max()),
            "wall_drawn_px": float(drawn.max())}
