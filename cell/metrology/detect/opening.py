"""What shape an opening has that is no whole round hole: slot, square, or a hole half covered.

Where the stripe is gone, the opening lies. Its outline is put into the smallest box, however
turned, and told by how much of each side of the box it runs along: both long sides of a slot alike,
all four of a square, the covered one of a hole that something covers.
"""

from __future__ import annotations

import cv2
import numpy as np

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.arrays import Grey, Indices, Mask
from cell.metrology.detect.ridge import Ridge
from cell.metrology.reasons import Reason

LEAST_GAP = 16     # px of the stripe, that an opening interrupts
UNLIKE = 0.3       # of the brighter one, by which opening and sheet differ
APPENDED = 0.2     # of the opening's size: what is narrower is dirt or shadow beside it
CLOSE = 0.05       # of the box's shorter side: so near, an outline runs along it
STEPS = 24         # parts of a side
STRAIGHT = 0.6    # of every side of a square; a circle runs along less than half
ONE_SIDED = 0.25   # of a side, by which a straight one differs from the one opposite
LONG = 1.15        # times as long as wide: a slot


def name_opening(image: Image, ridge: Ridge) -> Reason | None:
    """Say why the opening in which a stripe is gone is no whole round hole.

    Returns:
        None where nothing tells: no opening with a clear outline, or one that is round.
    """
    gap = _gap(ridge)
    if len(gap) < LEAST_GAP or gap[0] == 0 or gap[-1] == ridge.length - 1:
        return None
    x, y = np.clip(np.rint(ridge.points(ridge.length)), 0, np.array(image.shape)[::-1] - 1).T
    columns, rows = x.astype(np.intp), y.astype(np.intp)
    outline = _outline(image, (columns, rows), gap, ~ridge.gone)
    if outline is None:
        return None
    if ((outline <= 1) | (outline >= np.array(image.shape[::-1]) - 2)).any():
        return "hole_cut_by_border"
    return _name_shape(outline)


def _name_shape(outline: Array) -> Reason | None:
    sides, aspect = _sides(outline)
    if sides.min() > STRAIGHT:
        return "not_round"
    if np.abs(sides[:2] - sides[2:]).max() > ONE_SIDED:
        return "half_occluded"
    return "slot" if aspect > LONG else None


def _gap(ridge: Ridge) -> Indices:
    """Give the longest run of lines on which the stripe is gone."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ridge.gone.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if len(starts) == 0:
        return np.zeros(0, dtype=np.intp)
    longest = int(np.argmax(ends - starts))
    return np.arange(starts[longest], ends[longest])


def _outline(image: Image, course: tuple[Indices, Indices], gap: Indices,
             there: Mask) -> Array | None:
    """Follow the outline (n, 2) px of what is as bright as the opening; None without contrast."""
    columns, rows = course
    calm = cv2.medianBlur(image, 5)
    along = calm[rows, columns].astype(np.float64)
    inside, sheet = float(np.median(along[gap])), float(np.median(along[there]))
    if abs(sheet - inside) < UNLIKE * max(sheet, inside):
        return None
    level = (sheet + inside) / 2.0
    open_ = (calm < level) if inside < sheet else (calm > level)
    own = _component(open_, rows[gap], columns[gap])
    if own is None:
        return None
    contours, _ = cv2.findContours(own, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(max(contours, key=len)[:, 0].astype(np.float64))


def _component(open_: Mask, rows: Indices, columns: Indices) -> Grey | None:
    """Choose the connected part (h, w) that covers most of some pixels, without what hangs on."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(open_.astype(np.uint8), connectivity=4)
    counts = np.bincount(labels[rows, columns], minlength=2)
    if counts[1:].max() == 0:
        return None
    label = int(counts[1:].argmax()) + 1
    own = (labels == label).astype(np.uint8)
    size = int(APPENDED * min(stats[label, cv2.CC_STAT_WIDTH], stats[label, cv2.CC_STAT_HEIGHT]))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * (size // 2) + 1,) * 2)
    opened = cv2.morphologyEx(own, cv2.MORPH_OPEN, kernel, borderType=cv2.BORDER_REPLICATE)
    return opened if opened.any() else None


def _sides(outline: Array) -> tuple[Array, float]:
    """Say how much of the box's four sides (4,) an outline runs along, and how long the box is
    against its width; the sides go round, so that the third lies opposite the first.
    """
    box = np.asarray(cv2.boxPoints(cv2.minAreaRect(outline.astype(np.float32))), dtype=np.float64)
    following = np.roll(box, -1, axis=0)
    lengths = np.linalg.norm(following - box, axis=1)
    close = max(1.5, CLOSE * float(lengths.min()))
    along = [_along(outline, start, end, close) for start, end in zip(box, following, strict=True)]
    return np.array(along), float(lengths.max() / max(lengths.min(), 1.0))


def _along(outline: Array, start: Array, end: Array, close: float) -> float:
    """Say how much of the side from start to end (2,) an outline runs along."""
    length = max(float(np.linalg.norm(end - start)), 1.0)
    direction, beyond = (end - start) / length, outline - start
    away = np.abs(beyond[:, 0] * direction[1] - beyond[:, 1] * direction[0])
    place = np.clip((beyond[away < close] @ direction) / length, 0.0, 0.999)
    return len(np.unique((place * STEPS).astype(int))) / STEPS
