"""What the records of a run must agree on, whatever they say: the plan, the order, the counts.

A chain of hashes shows that nothing was changed since, not that it made sense when it was written.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Stop
from cell.core.documents.result import NotMeasured


def contradictions(papers: Papers, records: Sequence[HoleRecord],
                   stop: Stop | None) -> Iterator[str]:
    """Find what cannot be in the records of one run, as sentences.

    Args:
        papers: those that the run was made with.
        records: the holes in the order in which they were recorded.
        stop: how it ended, None where the run died.
    """
    planned = [hole.id for hole in papers.planned_holes]
    visits = Counter(record.observation.hole_id for record in records)
    for at, record in enumerate(records):
        yield from (f"hole {record.observation.hole_id}: {problem}"
                    for problem in _of_a_hole(at, record))
    yield from (f"hole {name}: is recorded {count} times" for name, count in visits.items()
                if count > 1)
    yield from (f"hole {name}: is not in the job's plan" for name in visits.keys() - set(planned))
    if stop is not None:
        yield from _of_the_end([name for name in planned if name not in visits], len(records), stop)


def _of_a_hole(at: int, record: HoleRecord) -> Iterator[str]:
    views, ends = len(record.observation.views), [attempt.views for attempt in record.attempts]
    if record.index != at:
        yield f"says that it is number {record.index}, and is number {at}"
    rising = all(first < second for first, second in pairwise([0, *ends]))
    if not (rising and ends[-1:] == [views] if views else ends == [0]):
        yield f"its attempts end after {ends} of {views} views"
    elif views == 0 and not isinstance(record.outcome, NotMeasured):
        yield "has a measurement and no view"


def _of_the_end(absent: Sequence[str], holes: int, stop: Stop) -> Iterator[str]:
    if stop.holes != holes:
        yield f"the end counts {stop.holes} holes; {holes} are recorded"
    if stop.status == "complete" and stop.result is None:
        yield "the run was complete, and has no result"
    if stop.status == "complete" and absent:
        yield f"the run was complete, and lacks {', '.join(absent)}"
