"""What an audit says of one recording: plain and small, so that other processes can send it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from cell.programs.audit.compare import Difference
from cell.recording.integrity import Check

Answer: TypeAlias = Literal["identical", "reproduced", "differs", "refused", "stays", "changes"]
"""The last two are those of a what-if: whether a verdict does, a feature's or the body's."""


@dataclass(frozen=True)
class Change:
    """One feature under a what-if: its verdicts and deviations as recorded and as they would be."""

    feature: str
    verdict: str
    verdict_then: str
    deviation: Mapping[str, float]
    deviation_then: Mapping[str, float]

    @property
    def turns(self) -> bool:
        """Whether the verdict changes."""
        return self.verdict != self.verdict_then


@dataclass(frozen=True)
class LogAudit:
    """The audit of one recording.

    `problem` says why it was refused, None where it was not. `numbers` counts the compared numbers
    by level; `differences` are those not identical. `versions` holds what differs between then and
    now: (recorded, here). `skipped` counts holes that could not be measured again since their
    images were pruned. `changes` belong to a what-if.
    """

    log: Path
    problem: str | None = None
    body_id: str = ""
    started: float = 0.0
    status: str = ""
    chain: str = ""
    holes: int = 0
    checks: tuple[Check, ...] = ()
    numbers: Counter[str] = field(default_factory=Counter)
    differences: tuple[Difference, ...] = ()
    versions: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    skipped: int = 0
    verdict: str | None = None
    verdict_then: str | None = None
    changes: tuple[Change, ...] = ()
    what_if: bool = False

    @property
    def turning(self) -> tuple[str, ...]:
        """The features whose verdicts change under the what-if."""
        return tuple(change.feature for change in self.changes if change.turns)

    @property
    def answer(self) -> Answer:
        """The worst of what was found."""
        if self.problem is not None:
            return "refused"
        if self.what_if:
            turns = self.turning or self.verdict != self.verdict_then
            return "changes" if turns else "stays"
        if self.numbers["differs"]:
            return "differs"
        return "reproduced" if self.numbers["reproduced"] else "identical"

    def exit_code(self, strict: bool = False) -> int:
        """Return 0 where the recording holds, 2 where it was refused, 1 where a number differs or,
        in a what-if, a verdict turns.

        Args:
            strict: count what is reproduced but not identical as different.
        """
        if self.answer == "refused":
            return 2
        different = self.answer in ("differs", "changes")
        return int(different or (strict and self.answer == "reproduced"))
