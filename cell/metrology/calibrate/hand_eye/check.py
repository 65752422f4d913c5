"""How well a hand-eye solution holds: on the board itself, and on views that it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array, Transform
from cell.metrology.calibrate.hand_eye.solve import (
    FEWEST_VIEWS,
    HandEyeProblem,
    HandEyeResult,
    solve_hand_eye,
)
from cell.metrology.motions import lay_onto

APART = 5          # views kept out of the fit
FEWEST_APART = 17  # views that a session needs for that; below it is judged in five folds


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The fit, and how far (mm, rms) views that a fit has not seen are missed.

    With seventeen views and more, five (`apart`) are kept out of the fit for good. With fewer, all
    are fitted, and `rms` comes from five further fits, each without a fifth of the views. Six leave
    none to judge by: not a number.
    """

    result: HandEyeResult
    apart: tuple[int, ...]
    rms: float


def solve_and_hold_out(problem: HandEyeProblem) -> HeldOut:
    """Solve, and judge the solution on views that were not fitted.

    Raises:
        ValueError: fewer than six views.
    """
    count = len(problem.views)
    if count == FEWEST_VIEWS:
        return HeldOut(solve_hand_eye(problem), (), float("nan"))
    if count >= FEWEST_APART:
        apart = tuple(int(index) for index in np.linspace(1, count - 2, APART).round())
        return solve_apart(problem, apart)
    unseen = np.concatenate([_missed(problem, fold) for fold in _folds(count)])
    return HeldOut(solve_hand_eye(problem), (), _rms(unseen))


def solve_apart(problem: HandEyeProblem, apart: Sequence[int]) -> HeldOut:
    """Solve without the views `apart`, and say how far those are missed."""
    fitted = [index for index in range(len(problem.views)) if index not in apart]
    result = solve_hand_eye(problem.take(fitted))
    return HeldOut(result, tuple(apart), _rms(miss(problem.take(apart), result)))


def object_rms(problem: HandEyeProblem, carrier_from_camera: Transform) -> float:
    """Measure how still the board stands (mm, rms): its points in all views against their mean.

    In each view the points are carried to the reference frame through that view's board pose, and
    the mean is the board laid onto all of them by least squares.
    """
    carried = np.concatenate(_carried(problem, carrier_from_camera))
    points = np.concatenate([view.board.points_in_board for view in problem.views])
    return _rms(carried - lay_onto(points, carried) @ points)


def miss(problem: HandEyeProblem, result: HandEyeResult) -> Array:
    """Measure by how much (n, 3) mm the board points of all views miss the solved board."""
    points = np.concatenate([view.board.points_in_board for view in problem.views])
    carried = np.concatenate(_carried(problem, result.carrier_from_camera))
    return carried - result.reference_from_board @ points


def _missed(problem: HandEyeProblem, fold: Sequence[int]) -> Array:
    fitted = [index for index in range(len(problem.views)) if index not in fold]
    return miss(problem.take(fold), solve_hand_eye(problem.take(fitted)))


def _folds(count: int) -> list[range]:
    """Split into five folds, or fewer where a fit would be left with too few views."""
    folds = 5 if count - -(-count // 5) >= FEWEST_VIEWS else count
    return [range(first, count, folds) for first in range(folds)]


def _carried(problem: HandEyeProblem, carrier_from_camera: Transform) -> list[Array]:
    reference_from_camera = problem.reference_from_carrier @ carrier_from_camera.matrix
    return [Transform(pose) @ view.board.camera_from_board @ view.board.points_in_board
            for pose, view in zip(reference_from_camera, problem.views, strict=True)]


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors ** 2, axis=1))))
