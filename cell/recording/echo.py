"""What a run's papers say twice, and a file says once.

A judgement repeats the outcome of every hole that it was made from, and the two-step estimate
repeats the points of the other. In the file the repetition is a reference; read back, it is whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from cell.core.documents.record import HoleRecord, Stop
from cell.core.documents.result import Measured, NotMeasured, Outcome
from cell.core.geometry import Array

ECHO = "as_recorded"
"""The reason that stands for: see the hole's own record."""

SAME = np.zeros((0, 0, 0, 0))
"""Stands for: the points of this name in the estimate that counts."""


def outcomes_of(record: HoleRecord) -> dict[str, Outcome]:
    """Return the outcome that counts of a hole, by its id; empty where there is none."""
    return {record.observation.hole_id: record.outcome} if record.attempts else {}


def say_stop_once(stop: Stop, outcomes: Mapping[str, Outcome]) -> Stop:
    """Replace every outcome that is the one of its hole by a reference."""
    def refer(outcome: Outcome) -> Outcome:
        own = outcomes.get(outcome.hole_id)
        return NotMeasured(outcome.hole_id, ECHO, "") if outcome is own else outcome

    return _with_outcomes(stop, refer)


def complete_stop(stop: Stop, outcomes: Mapping[str, Outcome]) -> Stop:
    """Put the outcomes of the holes back.

    Raises:
        ValueError: a reference to a hole that is not there.
    """
    def resolve(outcome: Outcome) -> Outcome:
        if not isinstance(outcome, NotMeasured) or outcome.reason != ECHO:
            return outcome
        if outcome.hole_id not in outcomes:
            raise ValueError(f"the end refers to hole {outcome.hole_id}, which is not there")
        return outcomes[outcome.hole_id]

    return _with_outcomes(stop, resolve)


def say_hole_once(record: HoleRecord) -> HoleRecord:
    """Replace the points that both estimates share by a reference."""
    def refer(points: Array, counting: Array | None) -> Array:
        same = counting is not None and points.shape == counting.shape \
            and points.tobytes() == counting.tobytes()
        return SAME if same else points

    return _with_traces(record, refer)


def complete_hole(record: HoleRecord) -> HoleRecord:
    """Put the shared points back.

    Raises:
        ValueError: a reference to points that are not there.
    """
    def resolve(points: Array, counting: Array | None) -> Array:
        if points.shape != SAME.shape:
            return points
        if counting is None:
            raise ValueError("an estimate refers to points that are not there")
        return counting

    return _with_traces(record, resolve)


def _with_outcomes(stop: Stop, change: Callable[[Outcome], Outcome]) -> Stop:
    if stop.result is None:
        return stop
    features = tuple(replace(feature, outcome=change(feature.outcome))
                     for feature in stop.result.features)
    return replace(stop, result=replace(stop.result, features=features))


def _with_traces(record: HoleRecord, change: Callable[[Array, Array | None], Array]) -> HoleRecord:
    return replace(record, attempts=tuple(
        replace(attempt, outcome=_with_trace(attempt.outcome, change))
        for attempt in record.attempts))


def _with_trace(outcome: Outcome, change: Callable[[Array, Array | None], Array]) -> Outcome:
    if not isinstance(outcome, Measured):
        return outcome
    counting = outcome.located.trace
    trace = {name: change(points, counting.get(name))
             for name, points in outcome.two_step.trace.items()}
    return replace(outcome, two_step=replace(outcome.two_step, trace=trace))
