"""The takt guard: which holes a body can do without when its time runs out."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cell.core.documents.nominals import Hole
from cell.core.documents.shift import Takt

MEMORY = 0.2
"""Share of the newest hole in the estimate of what a hole takes."""


class TaktGuard:
    """Keeps the time of one body after another. Times are of a clock that never steps back."""

    def __init__(self, takt: Takt) -> None:
        self._takt, self._hole_s = takt, takt.hole_s
        self._began = 0.0

    def begin(self, now: float) -> None:
        """Start the time of a body."""
        self._began = now

    def learn(self, seconds: float) -> None:
        """Learn from what a hole took."""
        self._hole_s += MEMORY * (seconds - self._hole_s)

    def seconds_left(self, now: float) -> float:
        """Give what remains of the takt, the way home kept aside."""
        return self._began + self._takt.seconds - self._takt.reserve_s - now

    def estimate(self, holes: int) -> float:
        """Estimate what so many holes take, in seconds."""
        return holes * self._hole_s

    def dropped(self, remaining: Sequence[Hole], now: float) -> frozenset[str]:
        """Choose the holes to drop so that the others fit: the first droppable class first, and in
        a class the last hole first, since time may yet be won. Others stay, whatever it takes.
        """
        late = self.estimate(len(remaining)) - self.seconds_left(now)
        surplus = max(0, math.ceil(late / self._hole_s)) if self._hole_s > 0 else 0
        order = self._takt.droppable
        candidates = sorted((hole for hole in reversed(remaining) if hole.importance in order),
                            key=lambda hole: order.index(hole.importance))
        return frozenset(hole.id for hole in candidates[:surplus])
