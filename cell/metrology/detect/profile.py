"""The grey profile across a rim: what lies behind, wall of the bore, sheet.

Along each ray the grey is  h (1 - F(far)) + p (F(near) + k (F(far) - F(near)))  with
near = (d - e) / s  and  far = (d - e + w) / s :  F is the normal distribution, h the grey behind
the hole, p the sheet's, k the wall's as a share of the sheet's, e where the sheet ends, w how wide
the wall shows, s the blur. Before the dark the wall is as dark, and k what it has beyond that.
Behind may be as bright as the sheet: the wall is then a dark ring between the two, and the only
edge there is. The sheet throws a soft shadow on what is lit behind it, so that h may fall toward
the rim: h + h' d.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from cell.core.geometry import Array
from cell.metrology.arrays import Indices


@dataclass(frozen=True, eq=False)
class Profile:
    """What the profiles of a rim share: the `blur` px; and on each ray where the sheet ends
    (`edge`, (n,) px along the normal), how wide the wall shows (`width`) and its `shade`: its grey
    as a share of the sheet's, beyond the dark behind it; or, before a `backlight` that is much
    brighter than the sheet, how much of the light it takes: its grey between the sheet's (0) and
    the light's (1). `sloped` says that something lit lies behind: the wall's grey is its own, and
    that behind may change along a ray, as the shadow of the sheet does.
    """

    edge: Array
    blur: float
    width: Array
    shade: Array
    sloped: bool = False
    backlight: bool = False

    def __getitem__(self, rays: Indices) -> Profile:
        """Return some of the rays."""
        return replace(self, edge=self.edge[rays], width=self.width[rays], shade=self.shade[rays])


@dataclass(frozen=True, eq=False)
class Comparison:
    """What grey profiles say once the two levels of each ray are fitted: the `levels` behind and on
    the sheet (n, 2), the `misfit` (n,) that remains (rms), all in grey values; and with the slopes
    of the profile by e, s, w and k, what the two levels can explain taken out of them, their
    `products` (n, p, p) with each other and their `pulls` (n, p): products with what remains.
    """

    levels: Array
    misfit: Array
    products: Array
    pulls: Array


def compare(offsets: Array, grey: Array, profile: Profile, *, slopes: int = 4) -> Comparison:
    """Compare grey profiles (n, m) with the model, and with its first `slopes` slopes: 1 or all 4.

    Of the signals on a ray only their products with each other are needed; what the levels explain
    leaves them by elimination (Gauss).
    """
    return explain(*_signals(offsets, grey, profile, slopes))


def explain(signals: Array, levels: Array) -> Comparison:
    """Compare the last of the signals on each ray (n, p + k + 1, m) with the first p, the slopes,
    once the k between them are taken out, whose `levels` (n, k) were fitted.
    """
    slopes = signals.shape[1] - levels.shape[1] - 1
    products = signals @ signals.swapaxes(1, 2)
    for level in range(slopes, signals.shape[1] - 1):
        share = products[:, level] / np.maximum(products[:, level, level], 1e-9)[:, None]
        products -= share[:, :, None] * products[:, None, level]
    misfit = np.sqrt(np.maximum(products[:, -1, -1], 0.0) / signals.shape[2])
    return Comparison(levels[:, -2:], misfit, products[:, :slopes, :slopes],
                      products[:, :slopes, -1])


def _signals(offsets: Array, grey: Array, profile: Profile, slopes: int) -> tuple[Array, Array]:
    """List the slopes, what the levels multiply and the grey (n, p, m), with the levels (n, k)."""
    near = (offsets - profile.edge[:, None]) / profile.blur
    far = near + np.maximum(profile.width, 0.0)[:, None] / profile.blur
    lift_near, lift_far, shade = ndtr(near), ndtr(far), profile.shade[:, None]
    wall = lift_far - lift_near
    like_light = shade if profile.backlight else 0.0 if profile.sloped else 1.0
    signals = np.empty((len(near), slopes + (4 if profile.sloped else 3), len(offsets)))
    signals[:, -3], signals[:, -1] = 1.0 - lift_far + like_light * wall, grey
    signals[:, -2] = lift_near + (1.0 - shade if profile.backlight else shade) * wall
    if profile.sloped:
        signals[:, -4] = offsets * (1.0 - lift_far)
    levels = fit_levels(signals[:, slopes:])
    behind, sheet = levels[:, -2, None], levels[:, -1, None]
    taken = behind - sheet if profile.backlight else sheet
    wall_grey = shade * taken + (sheet if profile.backlight else like_light * behind)
    if profile.sloped:
        behind = behind + levels[:, :1] * offsets
    bell_near = (wall_grey - sheet) / profile.blur * bell(near)
    bell_far = (behind - wall_grey) / profile.blur * bell(far)
    signals[:, 0] = bell_near + bell_far
    if slopes > 1:
        signals[:, 1] = bell_near * near + bell_far * far
        signals[:, 2] = -bell_far * (profile.width > 0.0)[:, None]
        signals[:, 3] = taken * wall
    return signals, levels


def fit_levels(signals: Array) -> Array:
    """Fit the last signal by the others (n, k + 1, m): how much of each it takes (n, k)."""
    products = signals @ signals.swapaxes(1, 2)
    if signals.shape[1] > 3:
        square = products[:, :-1, :-1] + 1e-6 * np.eye(signals.shape[1] - 1)
        return np.asarray(np.linalg.solve(square, products[:, :-1, -1:])[..., 0])
    (aa, ab, ag), (_, bb, bg), _ = products.transpose(1, 2, 0)  # two by hand: many are needed
    scale = np.maximum(aa * bb - ab * ab, 1e-9)
    return np.column_stack([bb * ag - ab * bg, aa * bg - ab * ag]) / scale[:, None]


def bell(x: Array) -> Array:
    """Give the density of the normal distribution."""
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))
