"""Rendered pairs, located with and without a plan, and how far off the answers are."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import cv2
import numpy as np

from cell.core.documents.calibration import SensorDocument
from cell.core.documents.text import parse
from cell.core.errors import UnmeasurableError
from cell.metrology.features import Expected
from cell.metrology.locate.pair import locate_pair
from ray_traced.invalid import draw_invalid
from ray_traced.pairs import render
from ray_traced.scenes import draw_scene
from ray_traced.varied import vary

LIMITS = {"easy": 0.03, "medium": 0.05, "hard": 0.08}  # mm in 3D, plus half the edge's ambiguity


@dataclass(frozen=True, eq=False)
class Answer:
    """What the locator said: the errors (4,) in mm and in u, or a reason."""

    error: np.ndarray | None = None
    in_u: np.ndarray | None = None
    reason: str | None = None

    @property
    def off(self):
        """The distance of the centre from the true one, mm."""
        return float(np.linalg.norm(self.error[:3]))


@dataclass(frozen=True, eq=False)
class Judged:
    """A pair's truth, and the answers with and without a plan."""

    truth: dict
    planned: Answer
    free: Answer

    @property
    def limit(self):
        return LIMITS[self.truth["difficulty"]] + self.truth["edge_ambiguity_mm"] / 2.0


def locate(pair, expected):
    """Locate a pair."""
    name = pair.sensor.name
    sensor = parse(SensorDocument, pair.sensor.as_yaml(), name).model
    try:
        found = locate_pair(pair.hole, pair.stripe, sensor, expected)
    except UnmeasurableError as refused:
        return Answer(reason=refused.reason)
    error = np.append(found.centre, found.radius) - [*pair.truth["centre_mm"],
                                                     pair.truth["radius_mm"]]
    return Answer(error, error / np.sqrt(np.diag(found.covariance)))


def judge(kind, seed):
    """Render the pair of a kind (valid, varied, invalid) and a seed, and locate it twice."""
    cv2.setNumThreads(1)
    pair = render(draw_invalid(seed) if kind == "invalid" else draw_scene(seed))
    if kind == "varied":
        pair = vary(pair, seed)
    plan = pair.truth["nominal"]
    try:
        planned = locate(pair, Expected(normal=np.array(plan["normal"]), radius=plan["radius_mm"],
                                        thickness=plan["thickness_mm"]))
        return Judged(pair.truth, planned, locate(pair, Expected()))
    except Exception as fault:
        fault.add_note(f"{kind} pair, seed {seed}")
        raise


def judge_all(kind, seeds):
    """Judge many pairs on all processors, in the order of their seeds."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return list(pool.map(judge, [kind] * len(seeds), seeds, chunksize=2))
