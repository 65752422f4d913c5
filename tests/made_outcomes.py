"""What was measured of the demo body: outcomes without images, for the tests of judging."""

import dataclasses

import numpy as np

from cell.core.documents.job import Alignment
from cell.core.documents.result import Located, Measured
from cell.core.geometry import Transform

DISPLACED = Transform.from_parts([0.0005, -0.0008, 0.001], [2.3, -1.4, 0.8])
SIGMA = 0.05
BEST_FIT = Alignment(method="best_fit", limit_mm=8.0, datums=dict.fromkeys(
    ("BP5", "SI1", "SI5", "AP1", "RR1", "QP1"), "xyz"))
RPS = Alignment(method="rps", limit_mm=8.0, datums={"SI1": "yz", "SI5": "xyz", "RR3": "y"})


def with_job(papers, **fields):
    return dataclasses.replace(papers, job=papers.job.model_copy(update=fields))


def measured(hole, centre, diameter=None, sigma=SIGMA):
    located = Located("joint", np.array([0.0, 0.0, 242.0]), hole.radius, None, np.eye(4))
    return Measured(hole.id, np.asarray(centre, float), diameter or hole.diameter,
                    np.eye(4) * sigma**2, hole.normal, located, located, 0)


def body(papers, body_from_nominal=None, noise=0.0, seed=1):
    """Outcomes of a body that is displaced as a whole, and each of its holes a little."""
    rng = np.random.default_rng(seed)
    moved = body_from_nominal or Transform.identity()
    return [measured(hole, moved @ (hole.centre + rng.normal(0, noise, 3)))
            for hole in papers.holes]


def by_id(result):
    return {feature.id: feature for feature in result.features}
