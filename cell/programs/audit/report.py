"""What an audit says of one recording: plain and small, so that other processes can send it."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from cell.core.errors import BUG, DocumentError
from cell.programs.audit.compare import Difference
from cell.recording.integrity import Check

Answer: TypeAlias = Literal["identical", "reproduced", "differs", "refused", "failed", "stays",
                            "changes"]
"""`refused` speaks of the recording, `failed` of the audit: it says nothing of the recording. The
last two are those of a what-if: whether a verdict does, a feature's or the body's."""


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

    `problem` says why there is no answer, None where there is one, and `error_code` what kind of
    error that is; `traceback` is that of a bug. `numbers` counts the compared numbers by level;
    `differences` are those not identical. `versions` holds what differs between then and
    now: (recorded, here). `skipped` counts holes that could not be measured again since their
    images were pruned. `changes` belong to a what-if.
    """

    log: Path
    problem: str | None = None
    error_code: int = DocumentError.exit_code
    traceback: str = ""
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
            return "refused" if self.error_code == DocumentError.exit_code else "failed"
        if self.what_if:
            turns = self.turning or self.verdict != self.verdict_then
            return "changes" if turns else "stays"
        if self.numbers["differs"]:
            return "differs"
        return "reproduced" if self.numbers["reproduced"] else "identical"

    def exit_code(self, strict: bool = False) -> int:
        """Return 0 where the recording holds, 1 where a number differs or, in a what-if, a verdict
        turns, 2 where it was refused, and the error's own code where the audit failed.

        Args:
            strict: count what is reproduced but not identical as different.
        """
        if self.problem is not None:
            return self.error_code
        different = self.answer in ("differs", "changes")
        return int(different or (strict and self.answer == "reproduced"))


def fault_of_the_program(log: Path, bug: Exception, checks: tuple[Check, ...] = ()) -> LogAudit:
    """Say that the audit of a recording failed by a bug: no word about the recording.

    Call it where the bug was caught. The traceback goes along as text, since other processes send
    none.
    """
    return LogAudit(log, f"a fault of the program: {bug!r}", BUG,
                    "".join(traceback.format_exception(bug)), checks=checks)
