"""The centre of a sphere of known radius, from sections of it: the check that is fitted to nothing.

Each pose lays one section through the sphere. Its points share the errors of the flange's pose, so
that what the poses disagree in tells what the whole way from laser to base is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.metrology.spread import middle, tukey_weights

FEWEST_POSES = 3
ROUNDS = 30
STRAY_ROUNDS = 6
STILL = 1e-6  # mm, below which the centre has come to rest


@dataclass(frozen=True, eq=False)
class SphereProblem:
    """Sections (n, 3) mm of one sphere in one frame, a pose each; `rough` (3,) is its centre to
    less than its radius.
    """

    sections: tuple[Array, ...]
    radius: float
    rough: Array


@dataclass(frozen=True, eq=False)
class SphereResult:
    """The sphere's `centre` (3,) mm with its `covariance` (3, 3) from leaving out pose by pose.

    `shifts` (poses, 3) is where each pose alone would have the centre against the common one,
    within its own section: across it, a section tells next to nothing. `residuals` (n,) mm are by
    pose; `radius` is what the points say where they are asked for it too.
    """

    centre: Array
    covariance: Array
    shifts: Array
    residuals: tuple[Array, ...]
    radius: float

    @property
    def rms(self) -> float:
        """The distance of the points from the sphere, root mean square (mm)."""
        return float(np.sqrt(np.mean(np.concatenate(self.residuals) ** 2)))

    @property
    def spread(self) -> float:
        """The shift of a pose, root mean square (mm)."""
        return float(np.sqrt(np.mean(np.sum(self.shifts ** 2, axis=1))))


def solve_sphere(problem: SphereProblem) -> SphereResult:
    """Solve the centre by least squares with the known radius, Tukey's weights.

    Raises:
        UnmeasurableError: `too_few_poses`; `no_sphere`, where the points lie on none.
    """
    if len(problem.sections) < FEWEST_POSES:
        raise UnmeasurableError("too_few_poses", f"the sphere was seen from {len(problem.sections)}"
                                                 f" poses; {FEWEST_POSES} are needed")
    centre = _centre(problem)
    fits = _fits(problem, centre)
    normals, misses, weights = _together(fits)
    free = _least_squares(np.column_stack([normals, np.ones_like(misses)]), misses, weights)
    shifts = np.array([fit.shift for fit in fits])
    return SphereResult(centre, _jackknife(fits), shifts, tuple(fit.misses for fit in fits),
                        problem.radius + float(free[3]))


@dataclass(frozen=True, eq=False)
class _Fit:
    """One section against a sphere: outward normals (n, 3), misses (n,) mm outside of it, weights
    (n,), and the shift (3,) of the centre that would suit this section alone, in its plane.
    """

    normals: Array
    misses: Array
    weights: Array
    shift: Array


def _centre(problem: SphereProblem) -> Array:
    centre = np.asarray(problem.rough, dtype=np.float64)
    for _ in range(ROUNDS):
        step = _least_squares(*_together(_fits(problem, centre)))
        centre = centre + step
        if np.linalg.norm(step) < STILL:
            return centre
    raise UnmeasurableError("no_sphere", "the points lie on no sphere of the known radius")


def _fits(problem: SphereProblem, centre: Array) -> list[_Fit]:
    return [_fit(points, centre, problem.radius) for points in problem.sections]


def _fit(points: Array, centre: Array, radius: float) -> _Fit:
    """Hold a section against the sphere. Strays are told by the section itself: a pose that stands
    elsewhere as a whole must keep its say.
    """
    arms = points - centre
    lengths = np.linalg.norm(arms, axis=1)
    normals, misses = arms / lengths[:, None], lengths - radius
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][:2]
    rows, weights = normals @ axes.T, np.ones_like(misses)
    shift = _least_squares(rows, misses, weights)
    for _ in range(STRAY_ROUNDS):
        weights = _weights(misses - rows @ shift)
        shift = _least_squares(rows, misses, weights)
    return _Fit(normals, misses, weights, shift @ axes)


def _together(fits: Sequence[_Fit]) -> tuple[Array, Array, Array]:
    return (np.concatenate([fit.normals for fit in fits]),
            np.concatenate([fit.misses for fit in fits]),
            np.concatenate([fit.weights for fit in fits]))


def _weights(misses: Array) -> Array:
    return tukey_weights(misses, max(1e-6, 1.4826 * middle(np.abs(misses))))


def _least_squares(rows: Array, misses: Array, weights: Array) -> Array:
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(rows * root[:, None], misses * root, rcond=None)[0])


def _jackknife(fits: Sequence[_Fit]) -> Array:
    """Tukey's estimate from the fits that each leave out one pose."""
    off = np.array([_least_squares(*_together([*fits[:index], *fits[index + 1:]]))
                    for index in range(len(fits))])
    off = off - off.mean(axis=0)
    return (len(fits) - 1) / len(fits) * off.T @ off
