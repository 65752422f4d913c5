"""The board: what a person at the cell sees, and what of it the line is told."""

from __future__ import annotations

from dataclasses import dataclass

from cell.core.ports import Fault, LineStatus


@dataclass(frozen=True)
class LastBody:
    """One of the last bodies, as the strip on the board shows it."""

    sequence: int
    body_id: str
    verdict: str
    trial: bool


@dataclass(frozen=True)
class Board:
    """One moment of a shift. `instruction` is the one thing that a person is to do now."""

    shift: str
    state: str = "starting"
    instruction: str = ""
    body_id: str = ""
    body_type: int = 0
    hole: int = 0
    holes: int = 0
    seconds_left: int = 0
    fault: Fault = ""
    detail: str = ""
    trial: bool = False
    busy: bool = False
    clear: bool = True
    bypass: str = ""
    line_alive: bool = True
    trouble: str = ""
    last: tuple[LastBody, ...] = ()

    @property
    def status(self) -> LineStatus:
        """What the line is told of it."""
        return LineStatus(
            self.state, ready=self.state in ("ready", "bypass"), busy=self.busy,
            clear=self.clear, master_due=self.state == "master_due",
            bypass=bool(self.bypass), trial=self.trial, fault=self.fault, hole=self.hole,
            holes=self.holes, seconds_left=max(0, self.seconds_left))
