"""Lay measured points onto their nominals: 3-2-1, RPS and best fit as one least-squares problem.

Every datum constrains the body axes that it lists, each weighted by its standard uncertainty. Six
constraints that hold the body are 3-2-1, solved exactly; more are RPS with redundancy; all three
axes of three or more points are a weighted best fit. The unknown is a small motion about the
current guess, found by Gauss-Newton with rotations and shifts scaled alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from cell.core.geometry import Array, Transform

STEPS = 20
SETTLED = 1e-10  # mm, of the last step
LOOSE = 1e-6  # of the largest singular value; below, a motion is not held


class UndeterminedError(ValueError):
    """Report datums that do not hold the body; `str()` says which motion is left free."""


@dataclass(frozen=True, eq=False)
class Datum:
    """One feature that holds the body: `nominal` (3,) in the body frame, `measured` (3,) in the
    frame it was measured in, both mm; `axes` of xyz of the body that it constrains, with the
    standard uncertainty `sigma` (3,) mm along each body axis.
    """

    id: str
    nominal: Array
    measured: Array
    axes: str = "xyz"
    sigma: tuple[float, float, float] = (0.1, 0.1, 0.1)

    @property
    def weights(self) -> tuple[float, ...]:
        """One over the standard uncertainty by body axis; 0 where it is not constrained."""
        return tuple(1.0 / sigma if axis in self.axes else 0.0
                     for axis, sigma in zip("xyz", self.sigma, strict=True))


@dataclass(frozen=True, eq=False)
class Registration:
    """Where the body lies.

    `body_from_measured` carries measured points to the body frame. `covariance` (6, 6) is that of a
    small turn (rad) and shift (mm) of it, order rx ry rz tx ty tz, about the body axes at `pivot`
    (3,); it rests on the datums' `sigma`. `residuals` are registered minus nominal in body axes
    (mm), by datum and constrained axis; `free` the same along the axes that are not constrained.
    `redundancy` counts the constraints beyond six, and `chi2` is the sum of squared residuals over
    `sigma`, by redundancy: some 1 where the datums' uncertainties are true. `left_out` tells by how
    much each datum's constraints are missed (largest, mm) when it is left out of the fit; None
    where the rest does not hold the body.
    """

    body_from_measured: Transform
    covariance: Array
    pivot: Array
    residuals: dict[str, dict[str, float]]
    free: dict[str, dict[str, float]]
    redundancy: int
    chi2: float | None = None
    left_out: dict[str, float | None] = field(default_factory=dict)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals over all constraints (mm)."""
        return float(np.sqrt(np.mean([value**2 for axes in self.residuals.values()
                                      for value in axes.values()])))

    @property
    def measured_from_body(self) -> Transform:
        """The way back: base_from_body where the points were measured in the base."""
        return self.body_from_measured.inverse

    def predict_covariance(self, points_in_body: ArrayLike) -> Array:
        """Predict the covariance (..., 3, 3) mm² that the registration gives points (..., 3)."""
        motion = _motion(np.asarray(points_in_body, dtype=np.float64) - self.pivot)
        return motion @ self.covariance @ np.swapaxes(motion, -1, -2)

    def predict_sigma(self, points_in_body: ArrayLike) -> Array:
        """Predict the standard uncertainty (..., 3) mm per body axis of points (..., 3)."""
        return np.sqrt(np.diagonal(self.predict_covariance(points_in_body), axis1=-2, axis2=-1))

    @property
    def covariance_of_measured_from_body(self) -> Array:
        """The covariance (6, 6) as `body/<job>.yaml` has it: a small turn of `measured_from_body`
        about the axes of the measuring frame, and the shift of the body's origin.
        """
        turn = self.measured_from_body.rotation
        carry = np.zeros((6, 6))  # (turn, shift at pivot) in body to (turn, shift at origin) there
        carry[:3, :3] = carry[3:, 3:] = -turn
        carry[3:, :3] = -turn @ _motion(-self.pivot)[:, :3]
        return carry @ self.covariance @ carry.T


def solve_body_registration(datums: Sequence[Datum], guess: Transform | None = None, *,
                       leave_out: bool = True) -> Registration:
    """Find the rigid motion that brings the datums' constrained axes onto their nominals.

    Args:
        datums: at least six constraints in all, spread so that they hold the body.
        guess: body_from_measured within some 20 degrees; None starts from the best fit of all
            points (Kabsch).
        leave_out: whether to solve again without each datum in turn.

    Raises:
        UndeterminedError: the constraints leave a motion free.
    """
    pivot = np.mean([datum.nominal for datum in datums], axis=0) if datums else np.zeros(3)
    found = _settled(datums, guess or _best_start(datums), pivot)
    rows, gaps = _linearise(datums, found, pivot)
    misses = {datum.id: found @ datum.measured - datum.nominal for datum in datums}
    redundancy = len(gaps) - 6
    return Registration(
        found, _held(rows, _span(datums, pivot)), pivot,
        {d.id: {a: float(misses[d.id]["xyz".index(a)]) for a in d.axes} for d in datums},
        {d.id: {a: float(misses[d.id]["xyz".index(a)]) for a in "xyz" if a not in d.axes}
         for d in datums},
        redundancy, float(gaps @ gaps) / redundancy if redundancy else None,
        {d.id: _miss_without(d, datums, found) for d in datums} if leave_out else {})


def _settled(datums: Sequence[Datum], guess: Transform, pivot: Array) -> Transform:
    """Go on by Gauss-Newton until the step is nothing."""
    span = _span(datums, pivot)
    for _ in range(STEPS):
        rows, gaps = _linearise(datums, guess, pivot)
        step = -_held(rows, span) @ rows.T @ gaps
        guess = _moved(guess, step, pivot)
        if np.abs(step[3:]).max() + np.abs(step[:3]).max() * span < SETTLED:
            break
    return guess


def _miss_without(datum: Datum, datums: Sequence[Datum], guess: Transform) -> float | None:
    """Predict a datum from the others: the largest miss along the axes that it constrains."""
    others = [other for other in datums if other.id != datum.id]
    try:
        fit = solve_body_registration(others, guess, leave_out=False)
    except UndeterminedError:
        return None
    miss = fit.body_from_measured @ datum.measured - datum.nominal
    return max(abs(float(miss["xyz".index(axis)])) for axis in datum.axes)


def _linearise(datums: Sequence[Datum], guess: Transform, pivot: Array) -> tuple[Array, Array]:
    """Stack one weighted row (6,) and one weighted gap a constraint."""
    measured = np.reshape([datum.measured for datum in datums], (-1, 3))
    nominal = np.reshape([datum.nominal for datum in datums], (-1, 3))
    weights = np.reshape([datum.weights for datum in datums], (-1, 3))
    here, held = guess @ measured, weights > 0.0
    rows = _motion(here - pivot) * weights[..., None]
    return rows[held], ((here - nominal) * weights)[held]


def _held(rows: Array, span: float) -> Array:
    """Invert the normal matrix by singular values; refuse a motion that no constraint sees."""
    scale = np.array([1.0 / span] * 3 + [1.0] * 3)  # a turn counts by what it moves at the span
    _, singular, motions = np.linalg.svd(np.vstack([rows * scale, np.zeros((6, 6))]),
                                         full_matrices=False)
    if singular[-1] <= LOOSE * singular[0]:
        raise UndeterminedError(_name_motion(motions[-1]))
    inverse = motions.T / singular
    return scale[:, None] * (inverse @ inverse.T) * scale


def _name_motion(motion: Array) -> str:
    turn, shift = motion[:3], motion[3:]
    kind, vector = ("turn about", turn) if np.linalg.norm(turn) > 0.5 else ("shift along", shift)
    unit = vector / np.linalg.norm(vector)
    return ("the datums do not hold the body: it can still "
            f"{kind} ({unit[0]:.2f}, {unit[1]:.2f}, {unit[2]:.2f})")


def _motion(arms: Array) -> Array:
    """Move points at `arms` (..., 3) from the pivot: (..., 3, 6) over turn and shift."""
    x, y, z = np.moveaxis(arms, -1, 0)
    o = np.zeros_like(x)
    turn = np.stack([np.stack([o, z, -y], -1), np.stack([-z, o, x], -1), np.stack([y, -x, o], -1)],
                    axis=-2)
    return np.concatenate([turn, np.broadcast_to(np.eye(3), turn.shape)], axis=-1)


def _moved(guess: Transform, step: Array, pivot: Array) -> Transform:
    """Turn and shift by a small motion about the pivot."""
    turn = Transform.from_parts(step[:3], np.zeros(3))
    return Transform.from_parts(turn.rotation @ guess.rotation,
                                turn @ (guess.translation - pivot) + pivot + step[3:])


def _span(datums: Sequence[Datum], pivot: Array) -> float:
    return max((float(np.linalg.norm(datum.nominal - pivot)) for datum in datums), default=1.0) \
        or 1.0


def _best_start(datums: Sequence[Datum]) -> Transform:
    """Best fit of all three axes of all points (Kabsch, Umeyama 1991)."""
    if len(datums) < 3:
        raise UndeterminedError("a registration without a first guess needs three points")
    nominal = np.array([datum.nominal for datum in datums])
    measured = np.array([datum.measured for datum in datums])
    cross = (nominal - nominal.mean(0)).T @ (measured - measured.mean(0))
    u, _, vt = np.linalg.svd(cross)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return Transform.from_parts(turn, nominal.mean(0) - turn @ measured.mean(0))
