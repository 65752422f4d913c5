"""What else could explain the misfit of a hand-eye solution: extra unknowns, to first order.

A board that was bumped half-way and a board of another size leave traces that the twelve unknowns
cannot take up. Each is added to the linearised fit; what the misfit falls to is the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.metrology.calibrate.hand_eye.solve import UNKNOWNS, HandEyeProblem, HandEyeResult, whiten

FEWEST_EACH_SIDE = 3  # views before and after a bump


@dataclass(frozen=True, eq=False)
class Explanation:
    """An extra unknown: its values, their standard uncertainties, and the fit's chi2 with it.

    `better` is the F ratio of what it explains.
    """

    values: Array
    sigmas: Array
    chi2: float
    better: float


@dataclass(frozen=True, eq=False)
class Bump:
    """The board seems to have moved by `shift` mm between two views (indices into the session)."""

    after_view: int
    before_view: int
    shift: float
    explanation: Explanation


def estimate_board_scale(problem: HandEyeProblem, result: HandEyeResult) -> Explanation:
    """Estimate by how much (1) the board is larger than entered."""
    boards = problem.camera_from_board
    away = np.einsum("nji,nj->ni", boards[:, :3, :3], boards[:, :3, 3])
    column = np.concatenate([np.zeros_like(away), away], axis=1)[..., None]
    return explain(result, whiten(result.roots, column))


def find_bump(problem: HandEyeProblem, result: HandEyeResult) -> Bump | None:
    """Find where between two views a moved board would explain the most; None with few views."""
    used = result.used
    places = range(FEWEST_EACH_SIDE, len(used) - FEWEST_EACH_SIDE + 1)
    tried = [(place, explain(result, _moved_from(result, used[place]))) for place in places]
    if not tried:
        return None
    place, best = min(tried, key=lambda one: one[1].chi2)
    return Bump(used[place - 1], used[place], _shift_of(problem, result, best.values), best)


def explain(result: HandEyeResult, columns: Array) -> Explanation:
    """Fit the residuals once more with extra whitened columns (n, 6, k) beside the unknowns."""
    used = list(result.used)
    rows = np.concatenate([result.jacobian, columns], axis=2)[used].reshape(
        -1, UNKNOWNS + columns.shape[2])
    misfit = result.whitened[used].ravel()
    step, *_ = np.linalg.lstsq(rows, -misfit, rcond=None)
    left = misfit + rows @ step
    chi2 = float(left @ left) / max(1, left.size - rows.shape[1])
    covariance = np.linalg.pinv(rows.T @ rows, hermitian=True) * max(1.0, chi2)
    better = float(misfit @ misfit - left @ left) / columns.shape[2] / max(chi2, 1e-12)
    return Explanation(step[UNKNOWNS:], np.sqrt(np.diag(covariance))[UNKNOWNS:], chi2, better)


def _moved_from(result: HandEyeResult, view: int) -> Array:
    """The board's six unknowns once more, for the views from this one on."""
    columns = result.jacobian[:, :, 6:].copy()
    columns[:view] = 0.0
    return columns


def _shift_of(problem: HandEyeProblem, result: HandEyeResult, nudge: Array) -> float:
    """How far (mm) a nudge of the board moves its middle."""
    points = np.concatenate([view.board.points_in_board for view in problem.views])
    arm = result.reference_from_board.turn(points.mean(axis=0))
    return float(np.linalg.norm(nudge[3:] + np.cross(nudge[:3], arm)))
