"""An ellipse through the edges that agree, whatever the others say."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from cell.core.geometry import Array
from cell.metrology.arrays import Indices, Mask
from cell.metrology.detect.band import Band
from cell.metrology.detect.edges import Edges
from cell.metrology.detect.ellipse import Ellipse
from cell.metrology.spread import middle, robust_sigma, tukey_weights

DRAWS = 256
GOLDEN = 0.6180339887498949


def agree(band: Band, edges: Edges, tolerance: float, *, free: int = 5) -> tuple[Ellipse, Mask]:
    """Find the ellipse near the band's own that most edges agree with (RANSAC).

    The draws are evenly spread (Weyl sequences), one edge from each of `free` equal sectors, so
    that the same edges always give the same answer.

    Args:
        band: the profiles; its ellipse is where the search starts.
        edges: all edges on them, right and wrong.
        tolerance: how near an edge has to be to agree, px.
        free: 5 for any ellipse, 3 to keep the shape and move only centre and size.

    Returns:
        The ellipse, and which edges agree (k,).
    """
    rows = _design(band, free)[edges.ray]
    picks = _draws(edges.ray, len(band.t), free)
    solved = _solve(rows[picks], edges.offset[picks])
    winner, miss = _best(solved, rows, edges, tolerance)
    return _moved(band.ellipse, winner, free), np.abs(miss) < tolerance


def agree_between(band: Band, edges: Edges, tolerance: float, ends: Array,
                  slack: float) -> tuple[Ellipse, Array]:
    """Find the ellipse of the band's shape that most edges agree with, of those that pass two
    `ends` (2, 2) px within some `slack`: one edge decides each draw.

    Returns:
        The ellipse, and how far from it each edge lies (k,) px.
    """
    design = _design(band, 3)
    toward = band.ellipse.inward(ends)
    at = replace(band, t=np.arctan2(toward[:, 1], toward[:, 0]))
    offset = ((ends - band.ellipse.points(at.t)) * at.normals).sum(axis=1)
    draw, rows = np.arange(DRAWS), design[edges.ray]
    pick = np.floor(len(rows) * np.mod(draw * GOLDEN, 1.0)).astype(np.intp)
    unsure = slack * (2.0 * np.mod(draw[:, None] * np.sqrt([2.0, 5.0]), 1.0) - 1.0)
    met = np.broadcast_to(_design(at, 3), (DRAWS, 2, 3))
    solved = _solve(np.concatenate([met, rows[pick, None]], axis=1),
                    np.column_stack([offset + unsure, edges.offset[pick]]))
    winner, miss = _best(solved, rows, edges, tolerance)
    return _moved(band.ellipse, winner, 3), miss


def _best(solved: Array, rows: Array, edges: Edges, tolerance: float) -> tuple[Array, Array]:
    """Choose the draw that most edges agree with, and tell how far (k,) px each is from it."""
    miss = np.minimum((solved @ rows.T - edges.offset) ** 2, tolerance**2)
    winner = solved[int(np.argmin(miss.sum(axis=1)))]
    return winner, rows @ winner - edges.offset


def settle(band: Band, edges: Edges, *, floor: float,
           free: int = 5) -> tuple[Ellipse, Array, float]:
    """Fit the ellipse to the edges near the band's own by Tukey's biweight.

    Args:
        band: the profiles; its ellipse is the start.
        edges: the edges.
        floor: the smallest scale that residuals are judged by, px.
        free: as in `agree`.

    Returns:
        The ellipse, the residuals (k,) px, and their robust standard deviation.
    """
    rows = _design(band, free)[edges.ray]
    step: Array = np.zeros(free)
    miss, scale = edges.offset, 1.0
    for _ in range(5):
        miss = edges.offset - rows @ step
        scale = max(floor, robust_sigma(miss))
        weight = np.sqrt(tukey_weights(miss - middle(miss), scale))  # all may be off alike at first
        step = _solve(rows * weight[:, None], edges.offset * weight)
    return _moved(band.ellipse, step, free), edges.offset - rows @ step, scale


def _design(band: Band, free: int) -> Array:
    if free == 5:
        return band.design
    growth = band.design[:, 2:] @ band.ellipse.shape[[0, 0, 1], [0, 1, 1]] / band.ellipse.radius
    return np.column_stack([band.design[:, :2], growth])


def _moved(ellipse: Ellipse, step: Array, free: int) -> Ellipse:
    if free == 5:
        return ellipse.moved(step)
    grown = ellipse.shape * (1.0 + step[2] / ellipse.radius)
    return Ellipse(ellipse.centre + step[:2], grown)


def _draws(ray: Indices, rays: int, free: int) -> Indices:
    """Draw `free` edges (DRAWS, free), each from a sector of its own, the first anywhere."""
    order = np.argsort(ray, kind="stable")
    picks = np.searchsorted(ray[order], rays * _turns(free))
    return order[np.minimum(picks, len(ray) - 1)]


@cache
def _turns(free: int) -> Array:
    draw, sector = np.arange(DRAWS)[:, None], np.arange(free)
    within = np.mod(draw * np.sqrt(2.0 + 3 * sector), 1.0)
    return np.asarray(np.mod(draw * GOLDEN + (sector + within) / free, 1.0))


def _solve(rows: Array, offset: Array) -> Array:
    across = rows.swapaxes(-1, -2)
    damped: Array = across @ rows + 1e-9 * np.eye(rows.shape[-1])
    return np.asarray(np.linalg.solve(damped, across @ offset[..., None])[..., 0])
