"""The outcomes in a stop record: those of its holes, said once.

A judgement repeats the outcome of every hole that it was made from. In the file it refers to the
hole instead, and is given back whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from cell.core.documents.record import HoleRecord, Stop
from cell.core.documents.result import NotMeasured, Outcome

ECHO = "as_recorded"
"""The reason that stands for: see the hole's own record."""


def outcomes_of(record: HoleRecord) -> dict[str, Outcome]:
    """Return the outcome that counts of a hole, by its id; empty where there is none."""
    return {record.observation.hole_id: record.outcome} if record.attempts else {}


def refer_to_holes(stop: Stop, outcomes: Mapping[str, Outcome]) -> Stop:
    """Replace every outcome that is the one of its hole by a reference."""
    def refer(outcome: Outcome) -> Outcome:
        own = outcomes.get(outcome.hole_id)
        return NotMeasured(outcome.hole_id, ECHO, "") if outcome is own else outcome

    return _with_outcomes(stop, refer)


def resolve_to_holes(stop: Stop, outcomes: Mapping[str, Outcome]) -> Stop:
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


def _with_outcomes(stop: Stop, change: Callable[[Outcome], Outcome]) -> Stop:
    if stop.result is None:
        return stop
    features = tuple(replace(feature, outcome=change(feature.outcome))
                     for feature in stop.result.features)
    return replace(stop, result=replace(stop.result, features=features))
