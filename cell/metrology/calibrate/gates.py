"""What a calibration must keep to before it may be measured with.

The numbers stand in one file, `gates.yaml`: `fine` for a cell of the UR10e class and
tolerances of half a millimetre, `coarse` for robots and distances some times larger.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from pydantic import model_validator

from cell.core.documents.base import Document, Number
from cell.metrology.calibrate.hand_eye.solve import RobotNoise

Ruling: TypeAlias = Literal["pass", "warn", "refuse"]
Level: TypeAlias = Literal["fine", "coarse"]


class Gate(Document):
    """The bounds of one figure: within the first it passes, beyond the second it is refused.

    Where `at_most` stands alone, nothing is refused: beyond it a person says why.
    """

    at_most: Number | None = None
    refuse_above: Number | None = None
    at_least: Number | None = None
    refuse_below: Number | None = None
    meaning: str

    @model_validator(mode="after")
    def _one_side(self) -> Gate:
        above = (self.at_most is not None, self.refuse_above is not None)
        below = (self.at_least is not None, self.refuse_below is not None)
        if {above, below} != {(True, True), (False, False)} and (above, below) != (
                (True, False), (False, False)):
            raise ValueError("a gate has either at_most and refuse_above, or at_least and "
                             "refuse_below")
        return self

    @property
    def limit(self) -> str:
        """The bounds as they are printed."""
        if self.at_most is not None:
            beyond = (f"refused above {self.refuse_above:g}" if self.refuse_above is not None
                      else "beyond it, say why")
            return f"<= {self.at_most:g} ({beyond})"
        return f">= {self.at_least:g} (refused below {self.refuse_below:g})"

    def rule(self, value: float) -> Ruling:
        """Judge a value; what is not a number is refused."""
        if math.isnan(value):
            return "refuse"
        if self.at_most is not None:
            return _ruling(value <= self.at_most,
                           self.refuse_above is None or value <= self.refuse_above)
        assert self.at_least is not None and self.refuse_below is not None
        return _ruling(value >= self.at_least, value >= self.refuse_below)


class NoiseDocument(Document):
    """What a reached robot pose is worth, per axis."""

    translation_mm: Number
    rotation_deg: Number

    @property
    def noise(self) -> RobotNoise:
        """As the solver takes it."""
        return RobotNoise(self.translation_mm, self.rotation_deg)


class GateSet(Document):
    """The gates of one level, by the step that they judge and the name of the figure."""

    robot: NoiseDocument
    camera: dict[str, Gate]
    light_plane: dict[str, Gate]
    hand_eye: dict[str, Gate]
    last_set: dict[str, Gate]
    sphere: dict[str, Gate]
    body: dict[str, Gate]
    drift_mm: dict[Literal["warn", "act", "stop"], Number]


class GateBook(Document):
    """`gates.yaml`."""

    fine: GateSet
    coarse: GateSet

    def level(self, level: Level) -> GateSet:
        """Choose the gates by name."""
        return self.fine if level == "fine" else self.coarse


@dataclass(frozen=True)
class Checked:
    """One figure held against its gate."""

    name: str
    value: float
    limit: str
    verdict: Ruling
    meaning: str

    @property
    def bound(self) -> str:
        """Within what the figure passes, without that beyond which it is refused."""
        return self.limit.partition(" (")[0]

    def __str__(self) -> str:
        return f"{self.meaning}: {self.value:.3g}, wanted {self.limit}"


def check_gates(values: Mapping[str, float], gates: Mapping[str, Gate]) -> tuple[Checked, ...]:
    """Hold every figure that has a gate against it, in the order of the gates."""
    return tuple(Checked(name, values[name], gate.limit, gate.rule(values[name]), gate.meaning)
                 for name, gate in gates.items() if name in values)


def worst(verdicts: Iterable[Ruling]) -> Ruling:
    """Find the worst of verdicts; pass where there is none."""
    order: tuple[Ruling, ...] = ("pass", "warn", "refuse")
    return max(verdicts, key=order.index, default="pass")


def _ruling(passes: bool, holds: bool) -> Ruling:
    return "pass" if passes else "warn" if holds else "refuse"
