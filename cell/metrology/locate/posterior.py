"""What is known of the circle after looking: one solution, or several where the tilt is wide open.

A rim says little of the sign of a small tilt: seen from straight ahead, a circle leaning left and
one leaning right look alike. Where the plan does not settle it, a wide prior of the turn about the
stripe is cut into narrow ones, each is solved, and each counts as much as it agrees with the data
(a Gaussian sum): the answer is their mean, and their spread is part of its uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cell.core.geometry import Array
from cell.metrology.locate.joint_problem import Prior, Problem, Solution, solve
from cell.metrology.locate.joint_rows import RADIUS, Circle

NARROW = 0.035  # rad: a turn within which the equations are as good as linear
WIDE = 2.5  # of the prior's standard deviations that are covered
NEGLIGIBLE = 1e-4  # of the weight


@dataclass(frozen=True, eq=False)
class Posterior:
    """Solutions and their weights (n,), which add up to one; all have the same tangents."""

    solutions: tuple[Solution, ...]
    weights: Array

    @property
    def circle(self) -> Circle:
        """The mean of the solutions."""
        return self.solutions[0].circle.moved(self.weights @ self._steps)

    @property
    def spread(self) -> Array:
        """The covariance (4, 4) of x, y, z and the radius between the solutions, mm²."""
        away = (self._steps - self.weights @ self._steps)[:, [0, 1, 2, RADIUS]]
        return np.asarray(away.T @ (away * self.weights[:, None]))

    @property
    def _steps(self) -> Array:
        first = self.solutions[0].circle
        return np.array([first.step_to(solution.circle) for solution in self.solutions])


def solve_all(problem: Problem, start: Circle) -> Posterior:
    """Solve a problem, prior by narrow prior where the normal's is wide."""
    if problem.prior.normal_sigma[0] <= 2.0 * NARROW:
        return Posterior((solve(problem, start),), np.ones(1))
    solutions, logarithms = [], []
    for prior, logarithm in _narrow(problem.prior):
        solution = solve(replace(problem, prior=prior), replace(start, turn=prior.turn))
        start = solution.circle  # the next one is not far
        solutions.append(solution)
        logarithms.append(logarithm + solution.log_evidence)
    weights = np.exp(np.array(logarithms) - np.nanmax(logarithms))
    kept = np.flatnonzero(weights > NEGLIGIBLE)  # and a number: a start far off may lead nowhere
    return Posterior(tuple(solutions[i] for i in kept), weights[kept] / weights[kept].sum())


def _narrow(prior: Prior) -> Iterator[tuple[Prior, float]]:
    """Cut the prior of the first turn into narrow ones, each with the logarithm of its weight."""
    sigma = np.sqrt(prior.normal_sigma[0]**2 - NARROW**2)
    count = int(np.ceil(WIDE * sigma / NARROW))
    for turn in NARROW * np.arange(-count, count + 1):
        narrow = replace(prior, turn=prior.turn + np.array([turn, 0.0]),
                         normal_sigma=np.array([NARROW, prior.normal_sigma[1]]))
        yield narrow, -0.5 * float(turn / sigma)**2
