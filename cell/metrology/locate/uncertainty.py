"""The budget of uncertainty: what each source adds to x, y, z and the radius.

An estimate by least squares answers to a small cause linearly; a source's share is the answer to
its cause, spread as the cause is (GUM, section 5.1). The sources in the camera frame:

| source | cause |
|---|---|
| `edge_noise` | scatter of the rim's points as measured in this image, neighbours alike |
| `stripe_noise` | scatter of the stripe's points as measured in this image, neighbours alike |
| `stripe_bias` | what the points of one stripe share: speckle, an asymmetric profile |
| `normal_prior` | what the plan's normal leaves open |
| `form` | ovality, and for the two-step method every wave of the rim |
| `radius_prior` | the plan's radius, where the rim is too short to do without |
| `edge_ambiguity` | burr, die roll, uneven light, the wall: what is seen is not the bore's edge |
| `light_plane`, `intrinsics` | the sensor's calibration |
| `method` | the two-step method's own error at the tilt that must be reckoned with |
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import SensorModel
from cell.metrology.features import Rim
from cell.metrology.locate.error_model import two_step_error
from cell.metrology.locate.joint_problem import Seen, Solution
from cell.metrology.locate.joint_rows import RADIUS
from cell.metrology.locate.posterior import Posterior

Budget: TypeAlias = dict[str, Array]
"""Covariances (4, 4) of x, y, z and the radius by source, mm²; sources are independent."""

FORM_SIGMA = 0.004  # mm, each wave of the rim: what punched and drilled holes show
CENTRE_DOUBT, RADIUS_DOUBT = 0.015, 0.06  # px: what light and edge break do to a clean rim
AMBIGUITY, SHARE = (0.3, 0.8), (0.08, 0.35)  # px, and the share of it that moves a centre
COMPLETE, HIDING = 0.8, 1.5  # of a rim are seen; px by which each share that is missing may mislead
SHOWN = [0, 1, 2, RADIUS]


def total(budget: Budget) -> Array:
    """Add up the sources: the covariance (4, 4)."""
    return np.asarray(sum(budget.values(), np.zeros((4, 4))))


def shares(budget: Budget) -> dict[str, tuple[float, float, float, float]]:
    """List each source's standard uncertainties of x, y, z and the radius (or diameter), mm."""
    return {source: _deviations(covariance) for source, covariance in budget.items()}


def joint_budget(posterior: Posterior, rim: Rim, sensor: SensorModel) -> Budget:
    """Split the uncertainty of the joint estimate by source.

    What lies between several solutions is what the normal's prior left open.
    """
    budget: Budget = {"normal_prior": posterior.spread}
    for solution, weight in zip(posterior.solutions, posterior.weights, strict=True):
        for source, share in solution_budget(solution, rim, sensor).items():
            budget[source] = budget.get(source, 0.0) + weight * share
    return budget


def solution_budget(solution: Solution, rim: Rim, sensor: SensorModel) -> Budget:
    """Split the uncertainty of a solution by source."""
    budget: Budget = {}
    for block in [*solution.seen, *solution.known]:
        answer = solution.covariance @ block.jacobian.T
        share = (answer @ answer.T)[np.ix_(SHOWN, SHOWN)]
        budget[block.source] = budget.get(block.source, 0.0) + share
    budget["edge_ambiguity"] = _edge_ambiguity(solution, rim)
    return budget | _sensor_budget(solution, sensor)


def two_step_budget(located: Array, solution: Solution, normal_sigma: float, rim: Rim,
                    sensor: SensorModel) -> Budget:
    """Turn the budget of the circle with a held normal into that of the two-step method.

    Args:
        located: x, y, z and the radius (4,) as the two-step method has them, mm.
        solution: what all points together give with that normal.
        normal_sigma: standard deviation of the normal per tangent axis, rad.
        rim: the rim that was seen.
        sensor: the sensor.
    """
    circle, plane = solution.circle, sensor.light_plane
    right = np.append(circle.centre, circle.radius)
    errors = [located - right]  # at the normal held; and what changes if it is another
    for tangent in circle.tangents:
        normals = circle.normal + normal_sigma * np.stack([-tangent, tangent])
        low, high = two_step_error(plane, circle.centre, normals, circle.radius)
        errors.append((high - low) / 2.0)
    budget = solution_budget(solution, rim, sensor)
    del budget["normal_prior"], budget["radius_prior"]
    two_points = np.diag([0.0, 0.0, 0.0, 2.0 * FORM_SIGMA**2])  # all even waves enter
    return budget | {"form": two_points, "method": np.asarray(np.transpose(errors) @ errors)}


def one_sided(rim: Rim) -> float:
    """Say by how much (px, standard) an ambiguous edge displaces a rim; the radius, by twice that.

    From rendered scenes: little of a small ambiguity does, for it goes round the rim. Where much of
    the rim is missing, something that is not understood hides it.
    """
    hidden = max(0.0, COMPLETE - rim.quality.get("coverage", 1.0))
    aside = rim.ambiguity * float(np.interp(rim.ambiguity, AMBIGUITY, SHARE))
    return float(np.hypot(aside, HIDING * hidden))


def _edge_ambiguity(solution: Solution, rim: Rim) -> Array:
    """Let the seen edge lie beside the bore's all round, more so on one side; or be drawn there by
    the wall.
    """
    points = solution.seen[0]
    toward = points.rows.toward
    aside = one_sided(rim)
    sigma = np.hypot([2.0 * aside, aside, aside], [RADIUS_DOUBT, CENTRE_DOUBT, CENTRE_DOUBT])
    beside = np.column_stack([np.ones(len(toward)), toward]) * sigma
    causes = np.column_stack([beside, np.broadcast_to(rim.drawn, len(toward))])
    return _spread(solution.response(points, causes), np.eye(4))


def _sensor_budget(solution: Solution, sensor: SensorModel) -> Budget:
    """Let the calibration be off: intrinsics shift every point, the light plane the stripe's."""
    causes = {"intrinsics": sensor.camera_covariance, "light_plane": sensor.light_plane_covariance}
    budget = {}
    for source, covariance in causes.items():
        if covariance is not None:
            answers = [solution.response(block, _shift_by(source, block, sensor))
                       for block in solution.seen]
            budget[source] = _spread(np.sum(answers, axis=0), covariance)
    return budget


def _shift_by(source: str, block: Seen, sensor: SensorModel) -> Array:
    if source == "light_plane":
        return block.rows.by_plane
    moved = sensor.camera.pixel_by_intrinsics(block.rows.normalised)
    return -np.einsum("ni,nij->nj", block.rows.toward, moved)


def _spread(answer: Array, covariance: Array) -> Array:
    shown = answer[SHOWN]
    return np.asarray(shown @ covariance @ shown.T)


def _deviations(covariance: Array) -> tuple[float, float, float, float]:
    x, y, z, radius = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    return x, y, z, radius
