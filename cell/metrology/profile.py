"""The grey profile across a rim, fitted to the pixels: hole, wall of the bore, sheet.

Along each ray the grey is  h + g S(d)  with  S = (1 - k) F((d - e) / s) + k F((d - e + w) / s) :
F is the normal distribution, e where the sheet ends, w how wide the wall shows, k the share of the
step g that the wall takes (negative where the wall is darker than what lies behind), s the blur.
Levels h and g belong to the ray; e lies on an ellipse; w follows from the shift of the far rim; k
is smooth round the rim; s is common. Least squares over the pixels is the maximum likelihood for a
camera's noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from cell.core.geometry import Array
from cell.metrology.arrays import Mask
from cell.metrology.band import Band
from cell.metrology.spread import tukey_weights
from cell.metrology.wall import Wall

STEPS = 6
SHARE_SIGMA, SHARE_SWING = 0.2, 0.1   # of k before looking, and of its change round the rim
DARKEST, BRIGHTEST = -0.6, 1.3        # k
CLEARLY = 0.95       # of the misfit
NOTABLE_WALL = 1.5   # px
NARROWEST, WIDEST, USUAL_BLUR = 0.4, 6.0, 1.2  # px
PIXELS_PER_ERROR = 30.0  # texture and smoothing: so many pixels go wrong together


@dataclass(frozen=True, eq=False)
class Profile:
    """What the profiles of a rim share: the `blur` px; and on each ray where the sheet ends
    (`edge`, (n,) px along the normal), how wide the wall shows (`width`) and its `share`.
    """

    edge: Array
    blur: float
    width: Array
    share: Array

    @property
    def wall_pull(self) -> Array:
        """How far (n,) px the wall draws an edge that is thought to have two levels only."""
        return self.share * np.maximum(self.width, 0.0)


@dataclass(frozen=True, eq=False)
class Step:
    """The step S (n, m) of every profile, and how it changes with e, w, s and k."""

    shape: Array
    by_edge: Array
    by_width: Array
    by_blur: Array
    by_share: Array


class RimModel:
    """The eleven numbers of a rim (ellipse 5, blur, shift of the far rim 2, share 3)."""

    def __init__(self, band: Band, wall: Wall) -> None:
        self.offsets, self.shrink = band.offsets, wall.shrink
        self.design, self.normals = band.ellipse.design(band.t), band.ellipse.normals(band.t)
        self.around = np.column_stack([np.ones_like(band.t), np.cos(band.t), np.sin(band.t)])
        self.prior = np.concatenate([np.zeros(5), [USUAL_BLUR], wall.shift,
                                     [wall.share, 0.0, 0.0]])
        self.sigma = np.array([np.inf] * 6 + [wall.sigma] * 2
                              + [SHARE_SIGMA, SHARE_SWING, SHARE_SWING])

    def read(self, x: Array) -> Profile:
        """Turn the eleven numbers into what each ray shows."""
        return Profile(self.design @ x[:5], float(np.clip(x[5], NARROWEST, WIDEST)),
                       self.shrink - self.normals @ x[6:8],
                       np.clip(self.around @ x[8:], DARKEST, BRIGHTEST))

    def onto_near_rim(self, wall: Wall) -> Array:
        """Give the move from the outline of what is seen through the bore to the near rim."""
        outward = np.maximum(self.shrink - self.normals @ wall.shift, 0.0)
        move = np.zeros_like(self.prior)
        move[:5] = np.linalg.lstsq(self.design, outward, rcond=None)[0]
        return move

    def linearise(self, grey: Array, x: Array) -> tuple[Array, Array]:
        """Give residuals (n, m) and how the model changes with the numbers (n, m, 11)."""
        step = _step(self.offsets, self.read(x))
        miss, height = _levels(grey, step.shape)
        slopes = np.concatenate([
            self.design[:, None] * step.by_edge[..., None], step.by_blur[..., None],
            -self.normals[:, None] * step.by_width[..., None],
            self.around[:, None] * step.by_share[..., None]], axis=2)
        return miss, _without_levels(slopes * height[:, None, None], step.shape)


def fit_profile(band: Band, rays: Mask, walls: list[Wall]) -> Profile:
    """Fit ellipse, blur and wall together to the pixels of the `rays` (n,) that agree.

    Where a wall of some width is to be expected, the band's ellipse may lie on its far side: the
    fit starts from both. Of all starts, the one that explains the pixels clearly better wins.
    """
    best, least = None, np.inf
    for wall in walls:
        model = RimModel(band, wall)
        starts = [model.prior]
        if wall.widest > NOTABLE_WALL:
            starts.append(model.prior + model.onto_near_rim(wall))
        for start in starts:
            profile, misfit = _descend(model, band.grey, rays, start)
            if best is None or misfit < CLEARLY * least:
                best, least = profile, misfit
    if best is None:
        raise ValueError("a profile is fitted with at least one wall in mind")
    return best


def _descend(model: RimModel, grey: Array, rays: Mask, state: Array) -> tuple[Profile, float]:
    """Fit from a start: the profile, and the typical misfit of a ray in grey values."""
    for _ in range(STEPS):
        miss, slopes = model.linearise(grey, state)
        rough = np.sqrt((miss**2).mean(axis=1))
        scale = max(float(np.median(rough[rays])), 1e-3)
        weight = rays * tukey_weights(np.maximum(rough - scale, 0.0), scale)
        stiff = PIXELS_PER_ERROR * (scale / model.sigma) ** 2
        flat = (slopes * weight[:, None, None]).reshape(-1, len(state))
        normal = flat.T @ slopes.reshape(-1, len(state)) + np.diag(stiff + 1e-9)
        right = flat.T @ miss.ravel() + stiff * (model.prior - state)
        state = state + np.clip(np.linalg.solve(normal, right), -0.5, 0.5)
    profile = model.read(state)
    miss, _ = _levels(grey, _step(model.offsets, profile).shape)
    return profile, float(np.sqrt((miss[rays] ** 2).mean(axis=1)).mean())


def locate_edges(band: Band, profile: Profile) -> tuple[Array, Array, Array]:
    """Locate the sheet's end on every ray by itself: offset (n,) px; and how high its step is and
    how badly it fits, both (n,) in grey values.
    """
    found = profile
    for _ in range(3):
        step = _step(band.offsets, found)
        miss, height = _levels(band.grey, step.shape)
        slope = _without_levels(step.by_edge[..., None], step.shape)[..., 0] * height[:, None]
        move = (slope * miss).sum(axis=1) / np.maximum((slope**2).sum(axis=1), 1e-9)
        found = replace(found, edge=found.edge + np.clip(move, -0.7, 0.7))
    miss, height = _levels(band.grey, _step(band.offsets, found).shape)
    return found.edge, height, np.sqrt((miss**2).mean(axis=1))


def _step(offsets: Array, profile: Profile) -> Step:
    near = (offsets - profile.edge[:, None]) / profile.blur
    shown = np.maximum(profile.width, 0.0)[:, None]
    far, share = near + shown / profile.blur, profile.share[:, None]
    bell_near, bell_far = _bell(near) / profile.blur, _bell(far) / profile.blur
    lift_near, lift_far = ndtr(near), ndtr(far)
    return Step(
        shape=(1.0 - share) * lift_near + share * lift_far,
        by_edge=-(1.0 - share) * bell_near - share * bell_far,
        by_width=share * bell_far * (shown > 0.0),
        by_blur=-(1.0 - share) * bell_near * near - share * bell_far * far,
        by_share=lift_far - lift_near)


def _bell(x: Array) -> Array:
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))


def _levels(grey: Array, shape: Array) -> tuple[Array, Array]:
    """Fit the two levels of every ray: residuals (n, m) and height of the step (n,)."""
    high = shape - shape.mean(axis=1, keepdims=True)
    centred = grey - grey.mean(axis=1, keepdims=True)
    height = (high * centred).sum(axis=1) / np.maximum((high**2).sum(axis=1), 1e-9)
    return centred - height[:, None] * high, height


def _without_levels(slopes: Array, shape: Array) -> Array:
    """Take out of slopes (n, m, p) what the two levels of each ray can explain."""
    high = shape - shape.mean(axis=1, keepdims=True)
    high = high / np.maximum(np.linalg.norm(high, axis=1, keepdims=True), 1e-9)
    centred = slopes - slopes.mean(axis=1, keepdims=True)
    return centred - high[..., None] * np.einsum("nm,nmp->np", high, centred)[:, None]
