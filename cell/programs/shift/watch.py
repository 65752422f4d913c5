"""Watching over one body: the takt, the line's abort, and refusals that are the cell's fault."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from cell.core.documents.nominals import Hole
from cell.core.documents.record import HoleRecord
from cell.core.documents.result import NotMeasured
from cell.core.documents.shift import FaultRules
from cell.core.ports import Fault
from cell.programs.shift.faults import HolesRefusedError
from cell.programs.shift.takt import TaktGuard
from cell.programs.shift.work import PreparedJob


class BodyWatch:
    """Asked before each hole of one body whether it is wanted.

    `look` is called every time: it follows the line and may raise to break the body off.
    """

    def __init__(self, job: PreparedJob, rules: FaultRules, guard: TaktGuard | None,
                 look: Callable[[int], None]) -> None:
        self.dropped: list[str] = []
        self._job, self._rules, self._guard, self._look = job, rules, guard, look
        self._forgiven = 0
        self._since: float | None = None

    def wanted(self, hole: Hole, records: Sequence[HoleRecord]) -> bool:
        """Tell whether `hole` is to be measured after `records`.

        Raises:
            HolesRefusedError: too many holes in a row, or a datum, could not be measured.
        """
        self._look(len(records))
        self.check(records)
        self._keep_time(records)
        if self._guard is None:
            return True
        if hole.id in self._guard.dropped(self._job.holes[len(records):], time.monotonic()):
            self.dropped.append(hole.id)
            return False
        return True

    def check(self, records: Sequence[HoleRecord]) -> None:
        """Raise where the latest refusals are a fault of the cell."""
        if len(records) <= self._forgiven:
            return
        latest = records[-1].outcome
        refused = self._refused_in_a_row(records)
        if self._rules.datum_missing and latest.hole_id in self._job.datums and refused:
            self._refuse(records, "datum_missing", f"the datum {latest.hole_id} was not measured")
        if len(refused) >= self._rules.refused_in_a_row:
            dark = {outcome.reason for outcome in refused} == {"no_laser"}
            self._refuse(records, "laser_dark" if dark else "holes_refused",
                         f"{len(refused)} holes in a row were not measured: "
                         + ", ".join(f"{o.hole_id} ({o.reason})" for o in reversed(refused)))

    def resume(self) -> None:
        """Begin the time of a hole anew: while the cell stood, no hole was measured."""
        self._since = None

    @property
    def remark(self) -> str:
        """Say which holes were dropped for the takt, or nothing."""
        return f"dropped for the takt: {', '.join(self.dropped)}" if self.dropped else ""

    def _refused_in_a_row(self, records: Sequence[HoleRecord]) -> list[NotMeasured]:
        """Give the refusals at the end of the records, the newest first."""
        refused: list[NotMeasured] = []
        for record in reversed(records[self._forgiven:]):
            if record.outcome.hole_id in self.dropped:
                continue
            if not isinstance(record.outcome, NotMeasured):
                break
            refused.append(record.outcome)
        return refused

    def _refuse(self, records: Sequence[HoleRecord], fault: Fault, sentence: str) -> None:
        self._forgiven = len(records)  # after the recovery they count no more
        raise HolesRefusedError(sentence, fault)

    def _keep_time(self, records: Sequence[HoleRecord]) -> None:
        now = time.monotonic()
        if self._guard and self._since is not None \
                and records[-1].outcome.hole_id not in self.dropped:
            self._guard.learn(now - self._since)
        self._since = now
