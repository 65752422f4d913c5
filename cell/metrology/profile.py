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
    """The step S: its `shape` (n, m), and how it changes with e, s, w and k: `slopes` (n, 4, m)."""

    shape: Array
    slopes: Array


def shape_step(offsets: Array, profile: Profile) -> Step:
    """Give the step S of every profile at `offsets` (m,) px, and its slopes."""
    near = (offsets - profile.edge[:, None]) / profile.blur
    shown = np.maximum(profile.width, 0.0)[:, None]
    far, share = near + shown / profile.blur, profile.share[:, None]
    bell_near, bell_far = (1.0 - share) * _bell(near), share * _bell(far)
    lift_near, lift_far = ndtr(near), ndtr(far)
    by_wall = lift_far - lift_near
    slopes = np.stack([-(bell_near + bell_far), -(bell_near * near + bell_far * far),
                       bell_far * (shown > 0.0), by_wall * profile.blur], axis=1) / profile.blur
    return Step(lift_near + share * by_wall, slopes)


def shape_edge(offsets: Array, profile: Profile) -> Step:
    """Give the step S of every profile, and its slope by where the sheet ends alone: (n, 1, m)."""
    near = (offsets - profile.edge[:, None]) / profile.blur
    far = near + np.maximum(profile.width, 0.0)[:, None] / profile.blur
    share = profile.share[:, None]
    slope = (share - 1.0) * _bell(near) - share * _bell(far)
    return Step((1.0 - share) * ndtr(near) + share * ndtr(far), slope[:, None] / profile.blur)


def fit_levels(grey: Array, shape: Array) -> tuple[Array, Array]:
    """Fit the two levels of every ray: residuals (n, m) and height of the step (n,)."""
    high = shape - shape.mean(axis=1, keepdims=True)
    centred = grey - grey.mean(axis=1, keepdims=True)
    square = np.einsum("nm,nm->n", high, high)
    height = np.einsum("nm,nm->n", high, centred) / np.maximum(square, 1e-9)
    return centred - height[:, None] * high, height


def without_levels(slopes: Array, shape: Array) -> Array:
    """Take out of slopes (n, p, m) what the two levels of each ray can explain."""
    high = shape - shape.mean(axis=1, keepdims=True)
    square = np.maximum(np.einsum("nm,nm->n", high, high), 1e-9)
    centred = slopes - slopes.mean(axis=2, keepdims=True)
    along = centred @ (high / square[:, None])[..., None]
    return np.asarray(centred - along * high[:, None])


def _bell(x: Array) -> Array:
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))
