"""The grey profile across a rim: hole, wall of the bore, sheet.

Along each ray the grey is  h + g S(d)  with  S = (1 - k) F((d - e) / s) + k F((d - e + w) / s) :
F is the normal distribution, e where the sheet ends, w how wide the wall shows, k the share of the
step g that the wall takes (negative where the wall is darker than what lies behind), s the blur.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from cell.core.geometry import Array
from cell.metrology.arrays import Indices


@dataclass(frozen=True, eq=False)
class Profile:
    """What the profiles of a rim share: the `blur` px; and on each ray where the sheet ends
    (`edge`, (n,) px along the normal), how wide the wall shows (`width`) and its `share`.
    """

    edge: Array
    blur: float
    width: Array
    share: Array

    def __getitem__(self, rays: Indices) -> Profile:
        """Return some of the rays."""
        return Profile(self.edge[rays], self.blur, self.width[rays], self.share[rays])

    @property
    def wall_pull(self) -> Array:
        """How far (n,) px the wall draws an edge that is thought to have two levels only."""
        return self.share * np.maximum(self.width, 0.0)


@dataclass(frozen=True, eq=False)
class Comparison:
    """What grey profiles say of a step once two levels of each ray are fitted: the `height` of the
    step (n,), the `misfit` (n,) that remains (rms), both in grey values; and with the slopes of the
    step, what the two levels can explain taken out of them, their `products` (n, p, p) with each
    other and their `pulls` (n, p): products with what remains.
    """

    height: Array
    misfit: Array
    products: Array
    pulls: Array


def shape_step(offsets: Array, profile: Profile) -> Array:
    """Give how the step S of every profile changes with e, s, w and k, and S itself (n, 5, m)."""
    near = (offsets - profile.edge[:, None]) / profile.blur
    shown = np.maximum(profile.width, 0.0)[:, None]
    far, share = near + shown / profile.blur, profile.share[:, None]
    bell_near, bell_far = (share - 1.0) * _bell(near), share * _bell(far)
    lift = ndtr(near)
    step = np.empty((len(near), 5, len(offsets)))
    step[:, 0] = (bell_near - bell_far) / profile.blur
    step[:, 1] = (bell_near * near - bell_far * far) / profile.blur
    step[:, 2] = bell_far * (shown > 0.0) / profile.blur
    step[:, 3] = ndtr(far) - lift
    step[:, 4] = lift + share * step[:, 3]
    return step


def shape_edge(offsets: Array, profile: Profile) -> Array:
    """Give how the step S changes with e alone, and S (n, 2, m)."""
    near = (offsets - profile.edge[:, None]) / profile.blur
    far = near + np.maximum(profile.width, 0.0)[:, None] / profile.blur
    share = profile.share[:, None]
    step = np.empty((len(near), 2, len(offsets)))
    step[:, 0] = ((share - 1.0) * _bell(near) - share * _bell(far)) / profile.blur
    step[:, 1] = (1.0 - share) * ndtr(near) + share * ndtr(far)
    return step


def compare(grey: Array, step: Array) -> Comparison:
    """Compare profiles (n, m) with a step and its slopes before it (n, p + 1, m).

    Of the signals on a ray only their products with each other are needed; what two levels explain
    leaves them by taking the means out of the signals, then the step out of the products (an
    elimination of Gauss).
    """
    signals = np.concatenate([step, grey[:, None]], axis=1)
    signals -= np.einsum("nsm->ns", signals)[..., None] / grey.shape[1]  # short rows: fast so
    products = signals @ signals.swapaxes(1, 2)
    share = products[:, -2] / np.maximum(products[:, -2, -2], 1e-9)[:, None]
    products -= share[:, :, None] * products[:, None, -2]
    height = share[:, -1]
    misfit = np.sqrt(np.maximum(products[:, -1, -1], 0.0) / grey.shape[1])
    return Comparison(height, misfit, products[:, :-2, :-2] * (height**2)[:, None, None],
                      products[:, :-2, -1] * height[:, None])


def _bell(x: Array) -> Array:
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))
