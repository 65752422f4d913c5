"""The joint estimate as least squares: equations weighted by what is known, solved by Gauss-Newton.

Rim and stripes speak through `joint_rows`; what a plan knows (normal, radius), and that a punched
hole is never quite round, speak as priors. Bayes' rule and least squares are the same thing here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.metrology.locate.joint_rows import (
    CENTRE,
    FORM,
    NORMAL,
    RADIUS,
    SHIFTS,
    Circle,
    Rows,
    Sight,
    StripeSight,
    rim_rows,
    stripe_rows,
)

MOST_STEPS = 12
STILL = 1e-4  # mm: a hundredth of what can be measured
HUBER = 3.0  # single points beyond so many sigma lose weight


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before looking: standard deviations of the normal's turns (2,) in rad about
    `turn` (2,), of the form's waves in mm, and of the radius in mm about `radius`.
    """

    turn: Array
    normal_sigma: Array
    form_sigma: float
    radius: float
    radius_sigma: float


@dataclass(frozen=True, eq=False)
class Known:
    """Equations of one source of uncertainty, each divided by its standard deviation."""

    source: str
    residual: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class Seen(Known):
    """Equations of points: the rows in px, and the weight (n,) in 1/px that each has."""

    rows: Rows
    weight: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """One rim, the stripes across it, and the prior."""

    rim: Sight
    stripes: tuple[StripeSight, ...]
    prior: Prior

    def seen(self, circle: Circle) -> list[Seen]:
        """Set up what the points say of a circle: the rim, then each stripe."""
        rim = _seen("edge_noise", rim_rows(circle, self.rim), self.rim)
        return [rim, *(_seen("stripe_noise", stripe_rows(circle, stripe, i), stripe.sight)
                       for i, stripe in enumerate(self.stripes))]

    def known(self, circle: Circle) -> list[Known]:
        """Set up what was known before of a circle."""
        unknowns, prior = np.eye(SHIFTS + len(self.stripes)), self.prior
        shift_sigma = np.array([stripe.shift_sigma for stripe in self.stripes])
        waves = np.full(circle.form.shape, prior.form_sigma)
        return [
            _known("normal_prior", circle.turn - prior.turn, unknowns[NORMAL], prior.normal_sigma),
            _known("form", circle.form, unknowns[FORM], waves),
            _known("radius_prior", np.array([circle.radius - prior.radius]),
                   unknowns[RADIUS:RADIUS + 1], np.array([prior.radius_sigma])),
            _known("stripe_bias", circle.shifts, unknowns[SHIFTS:], shift_sigma),
        ]


@dataclass(frozen=True, eq=False)
class Solution:
    """The circle, the covariance of all unknowns, and the equations at the solution."""

    circle: Circle
    covariance: Array
    seen: list[Seen]
    known: list[Known]

    @property
    def log_evidence(self) -> float:
        """How well data and prior agree: comparable between priors of the same widths."""
        cost = sum(float(block.residual @ block.residual) for block in [*self.seen, *self.known])
        return 0.5 * float(np.linalg.slogdet(self.covariance)[1]) - 0.5 * cost

    def response(self, points: Seen, shift: Array) -> Array:
        """Compute how the unknowns answer to shifts (n, k) of points in the image, in px."""
        return np.asarray(-self.covariance @ points.jacobian.T @ (shift * points.weight[:, None]))


def solve(problem: Problem, start: Circle) -> Solution:
    """Solve the least squares from a start; converges quadratically from the conic's answer."""
    solution, step = _step(problem, start)
    for _ in range(MOST_STEPS):
        if np.abs(step[CENTRE]).max() < STILL:
            break
        solution, step = _step(problem, solution.circle)
    return solution


def _step(problem: Problem, circle: Circle) -> tuple[Solution, Array]:
    """Take one step of Gauss-Newton; what is nearly still is differentiated well enough."""
    seen, known = problem.seen(circle), problem.known(circle)
    information, slope = _normal_equations([*seen, *known])
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    step = -covariance @ slope
    return Solution(circle.moved(step), covariance, seen, known), step


def _normal_equations(blocks: list[Known]) -> tuple[Array, Array]:
    information = sum(block.jacobian.T @ block.jacobian for block in blocks)
    slope = sum(block.jacobian.T @ block.residual for block in blocks)
    return np.asarray(information), np.asarray(slope)


def _seen(source: str, rows: Rows, sight: Sight) -> Seen:
    """Weigh points: neighbours share errors, and those far off lose weight (Huber)."""
    single = np.abs(rows.residual) / sight.sigma
    robust = np.sqrt(np.minimum(1.0, HUBER / np.maximum(single, HUBER)))
    weight = robust / (sight.sigma * np.sqrt(sight.correlation))
    return Seen(source, rows.residual * weight, rows.jacobian * weight[:, None], rows, weight)


def _known(source: str, difference: Array, rows: Array, sigma: Array) -> Known:
    return Known(source, difference / sigma, rows / sigma[:, None])
