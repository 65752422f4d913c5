"""The rim fitted to the pixels around it: ellipse, blur and wall together, then ray by ray.

Each ray has two levels of its own; the sheet's end lies on an ellipse; the wall's width follows
from the shift of the far rim; its shade is smooth round the rim; the blur is common.
Least squares over the pixels is the maximum likelihood for a camera's noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cell.core.geometry import Array
from cell.metrology.arrays import Mask
from cell.metrology.detect.band import Band
from cell.metrology.detect.profile import Profile, compare
from cell.metrology.detect.wall import Wall
from cell.metrology.spread import middle, tukey_weights

STEPS = 7
WORSE = 1.05          # of the least misfit so far: a step has gone too far
SETTLED = 0.005       # px and shades: below, the fit has arrived
FEW = 100             # rays, or fewer, tell which wall it is
THINNED = 2           # every second ray tells enough of blur and wall
DARKEST, BRIGHTEST = -0.6, 1.5        # k
NOTABLE_WALL = 1.5                    # px
NARROWEST, WIDEST, USUAL_BLUR = 0.4, 6.0, 1.2  # px
SECTORS = 12          # of a rim
PIXELS_PER_ERROR = 60.0  # texture and smoothing: so many pixels go wrong together


class RimModel:
    """The eleven numbers of a rim: ellipse 5, blur, shift of the far rim 2, wall's shade 3."""

    def __init__(self, band: Band, wall: Wall, sharpest: float) -> None:
        self.wall, self.sharpest = wall, sharpest
        self.design, self.normals = band.design, band.normals
        self.around = np.column_stack([np.ones_like(band.t), np.cos(band.t), np.sin(band.t)])
        self.prior = np.array([0.0] * 5 + [USUAL_BLUR, *wall.shift, wall.shade, 0.0, 0.0])
        self.sigma = np.array([np.inf] * 6 + [wall.sigma] * 2
                              + [wall.shade_sigma, wall.shade_sigma / 2.0, wall.shade_sigma / 2.0])

    def read(self, x: Array) -> Profile:
        """Turn the eleven numbers into what each ray shows."""
        return Profile(self.design @ x[:5], float(np.clip(x[5], self.sharpest, WIDEST)),
                       self.wall.shrink - self.normals @ x[6:8],
                       np.clip(self.around @ x[8:], DARKEST, BRIGHTEST),
                       self.wall.sloped, self.wall.backlight)

    def rows(self) -> Array:
        """Give how edge, blur, width and shade of each ray follow from the numbers (n, 4, 11)."""
        rows = np.zeros((len(self.design), 4, 11))
        rows[:, 0, :5], rows[:, 1, 5] = self.design, 1.0
        rows[:, 2, 6:8], rows[:, 3, 8:] = -self.normals, self.around
        return rows

    def onto_near_rim(self) -> Array:
        """Give the move from the outline of what is seen through the bore to the near rim."""
        outward = np.maximum(self.wall.width(self.normals), 0.0)
        move = np.zeros_like(self.prior)
        move[:5] = np.linalg.lstsq(self.design, outward, rcond=None)[0]
        return move


def fit_profile(band: Band, rays: Mask, walls: list[Wall], *, doubled: bool = True,
                sharpest: float = NARROWEST) -> Profile:
    """Fit ellipse, blur and wall together to the pixels of the `rays` (n,) that agree.

    Where a wall of some width is to be expected, the band's ellipse may lie on its far side: the
    fit starts from both. Of all starts, the one that explains the pixels better by what the
    wall is worth wins.

    Args:
        band: the profiles.
        rays: which of them to use.
        walls: what the wall may be; the first is preferred.
        doubled: whether two rims may show.
        sharpest: the least blur that the lens leaves any edge, px.
    """
    used = np.flatnonzero(rays)
    few = band[used[::1 + len(used) // FEW]]
    best, least, chosen = np.zeros(11), np.inf, walls[0]
    by_shade = len(walls) == 2  # one wall, dark or lit
    for wall in walls:
        model = RimModel(few, wall, sharpest)
        starts = [model.prior]
        if doubled and wall.widest > NOTABLE_WALL:
            starts.append(model.prior + model.onto_near_rim())
        if by_shade and wall is walls[1]:  # its shade is another, and all else not far
            starts = [np.append(best[:6], model.prior[6:])]
        for start in starts:
            state, misfit = _descend(model, few, start)
            if by_shade:  # which the profiles tell by themselves; waves of the rim would mislead
                misfit = float(locate_edges(few, model.read(state))[2].mean())
            if misfit < wall.worth * least:
                best, least, chosen = state, misfit, wall
    thinned = band[used[::THINNED]]
    best, _ = _descend(RimModel(thinned, chosen, sharpest), thinned, best)
    return RimModel(band, chosen, sharpest).read(best)


def _descend(model: RimModel, band: Band, state: Array) -> tuple[Array, float]:
    """Fit from a start (Gauss-Newton): the numbers, and the mean misfit of a ray in grey."""
    rows = model.rows()
    flat, least, best = rows.reshape(-1, len(state)), np.inf, state
    for _ in range(STEPS):
        seen = compare(band.offsets, band.grey, model.read(state))
        misfit, scale = float(seen.misfit.mean()), max(middle(seen.misfit), 1e-3)
        if misfit > WORSE * least:  # too far: the wall's width and shade are no linear matter
            state = (state + best) / 2.0
            continue
        least, best = misfit, state
        weight = tukey_weights(np.maximum(seen.misfit - scale, 0.0), scale)
        stiff = PIXELS_PER_ERROR * (scale / model.sigma) ** 2
        weighed = (seen.products * weight[:, None, None]) @ rows
        normal = flat.T @ weighed.reshape(flat.shape)
        right = flat.T @ (seen.pulls * weight[:, None]).ravel() + stiff * (model.prior - state)
        move = np.clip(np.linalg.solve(normal + np.diag(stiff + 1e-9), right), -0.5, 0.5)
        state = state + move
        if np.abs(move).max() < SETTLED:
            break
    return state, least


def locate_edges(band: Band, profile: Profile) -> tuple[Array, Array, Array]:
    """Locate the sheet's end on every ray by itself: offset (n,) px; how well its profile tells it,
    (n,) px; and how badly that fits, (n,) in grey values.
    """
    nearer, _, _ = _nearer(band, profile)
    nearest, unsure, misfit = _nearer(band, nearer)
    return nearest.edge, unsure, misfit


def _nearer(band: Band, profile: Profile) -> tuple[Profile, Array, Array]:
    """Move the edges of a profile once (Newton): how well they are told, and what then remains."""
    seen = compare(band.offsets, band.grey, profile, slopes=1)
    square, pull = np.maximum(seen.products[:, 0, 0], 1e-9), seen.pulls[:, 0]
    move = np.clip(pull / square, -1.0, 1.0)
    explained = move * (2.0 * pull - move * square) / len(band.offsets)
    misfit = np.sqrt(np.maximum(seen.misfit**2 - explained, 0.0))
    return replace(profile, edge=profile.edge + move), misfit / np.sqrt(square), misfit


def uneven_blur(band: Band, profile: Profile) -> float:
    """Measure how the blur's variance (px²) differs from sector to sector of a rim.

    The lens blurs a rim all round alike; the lip of a burr or of a die roll does not.
    """
    seen = compare(band.offsets, band.grey, profile)
    tie = seen.products[:, 0, 1] / np.maximum(seen.products[:, 0, 0], 1e-9)  # edges may move
    sector = (band.t * (SECTORS / (2.0 * np.pi))).astype(np.intp)
    pull = np.bincount(sector, seen.pulls[:, 1] - tie * seen.pulls[:, 0], SECTORS)
    weight = np.bincount(sector, seen.products[:, 1, 1] - tie * seen.products[:, 0, 1], SECTORS)
    told = weight > 0.1 * weight.mean()
    return float(2.0 * profile.blur * np.std(pull[told] / weight[told]))
