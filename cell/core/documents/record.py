"""The papers of a run: a start with everything known before the first move, one record a hole, a
stop with status and counts. A run without a stop record died.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from cell.core.documents.result import BodyResult, Outcome
from cell.core.observation import Observation

SCHEMA = 1
"""Version of the recording format; a reader refuses a newer one."""

Status: TypeAlias = Literal["complete", "aborted", "interrupted", "fault"]


@dataclass(frozen=True)
class Start:
    """Everything known before the first move.

    `papers` are the exact texts of the documents by name: `job`, `nominals`, `cell`, `sensor`,
    `hand_eye`, `body`, and where they exist `offsets`, `kinematics`. `conditions` are numbers
    that enter the judgement (`part_temperature_c`). `versions` names software and the processor
    features that numpy and OpenCV dispatch on. `started` is in seconds since 1970 (UTC).
    """

    recording_id: str
    body_id: str
    started: float
    set_id: str
    papers: Mapping[str, str]
    versions: Mapping[str, str]
    robot: Mapping[str, str]
    conditions: Mapping[str, float] = field(default_factory=dict)
    trial: bool = True
    simulated: bool = False
    schema: int = SCHEMA


@dataclass(frozen=True, eq=False)
class Attempt:
    """What `measure_hole` said after the first `views` views, and what was decided then: `accept`,
    `same_again`, `other_exposure`, `recentre`, `give_up`.
    """

    views: int
    outcome: Outcome
    decision: str = "accept"


@dataclass(frozen=True, eq=False)
class HoleRecord:
    """One hole: what was seen, and every outcome in the order in which it was reached."""

    index: int
    observation: Observation
    attempts: tuple[Attempt, ...]

    @property
    def outcome(self) -> Outcome:
        """The outcome that counts: the last."""
        return self.attempts[-1].outcome


@dataclass(frozen=True, eq=False)
class Stop:
    """How the run ended. `result` is the judgement of the body, None where it never came to one."""

    status: Status
    finished: float
    holes: int
    reason: str = ""
    result: BodyResult | None = None
