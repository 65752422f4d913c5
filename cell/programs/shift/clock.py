"""Two clocks: the one on the wall, which people set, and the one that only goes forward."""

from __future__ import annotations

import time
from collections.abc import Callable

TOLERATED = 2.0
"""Seconds that the wall clock may be off before it is a step; time servers slew."""


class WatchedClock:
    """Tells the time and notices when somebody sets the clock."""

    def __init__(self, wall: Callable[[], float] = time.time,
                 steady: Callable[[], float] = time.monotonic) -> None:
        self._wall, self._steady = wall, steady
        self._offset = wall() - steady()

    def now(self) -> float:
        """Give seconds since 1970 (UTC), as the wall clock shows them."""
        return self._wall()

    def steady(self) -> float:
        """Give seconds of a clock that never steps."""
        return self._steady()

    def step(self) -> float:
        """Give how far the wall clock has stepped since it was last asked; 0 where it has not."""
        offset = self._wall() - self._steady()
        step = offset - self._offset
        if abs(step) < TOLERATED:
            return 0.0
        self._offset = offset
        return step
