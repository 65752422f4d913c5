"""The desk of a shift: orders come in, what the cell does goes out to the line and the screen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cell.core.documents.shift import ShiftDocument
from cell.core.ports import Line, Order, Refusal
from cell.programs.shift.board import Board, LastBody
from cell.programs.shift.clock import WatchedClock
from cell.results.booking import Row
from cell.results.ledger import Ledger

STRIP = 20
"""Bodies on the strip of the last ones."""


class Desk:
    """Holds the board, and follows the orders that may come at any time: bypass and stop."""

    def __init__(self, document: ShiftDocument, line: Line, ledger: Ledger, clock: WatchedClock,
                 show: Callable[[Board], None]) -> None:
        self.document, self.line, self.ledger, self.clock = document, line, ledger, clock
        self.board = Board(document.name, clear=False)
        self.bypass: Row | None = ledger.current_bypass()
        self.stopping = self.interrupted = False
        self._show = show

    def update(self, **changes: Any) -> None:  # noqa: ANN401  the fields of a Board
        """Change the board, and show it to the line and on the screen."""
        self.board = replace(self.board, line_alive=self.line.alive(),
                             bypass=str(self.bypass["reason"]) if self.bypass else "", **changes)
        self.line.show(self.board.status)
        self._show(self.board)

    def interrupt(self) -> None:
        """End the shift now: a person at the terminal says so."""
        self.stopping = self.interrupted = True

    def add_to_strip(self, visit: Row) -> None:
        """Show a body's verdict among the last ones."""
        last = LastBody(visit["sequence"], visit["body_id"], visit["verdict"], visit["trial"])
        self.update(last=(*self.board.last, last)[-STRIP:])

    def look(self, timeout: float) -> Order | None:
        """Wait for an order; one that may come at any time is followed here and not returned."""
        self._look_at_the_clock()
        self._end_bypass_in_time()
        order = self.line.take(timeout)
        self.update()
        if order is None or order.command not in ("stop", "bypass", "end_bypass"):
            return order
        self.line.answer(order, self._follow(order))
        return None

    def _follow(self, order: Order) -> Refusal:
        if order.command == "stop":
            self.stopping = True
        elif order.command == "bypass" and not (order.operator and order.reason):
            return "not_named"
        elif order.command == "bypass" and self.bypass is None:
            self._begin_bypass(order)
        elif order.command == "end_bypass" and self.bypass is not None:
            self._end_bypass(order.operator or "line")
        else:
            return "nothing_to_do"
        return ""

    def _begin_bypass(self, order: Order) -> None:
        rules, now = self.document.bypass, self.clock.now()
        reason = rules.reasons.get(order.reason, order.reason)
        self.bypass = self.ledger.open_bypass(order.operator, reason, now,
                                              now + 60.0 * rules.at_most_min)

    def _end_bypass(self, by: str) -> None:
        assert self.bypass is not None
        self.ledger.close_bypass(self.bypass, by, self.clock.now())
        self.bypass = None

    def _end_bypass_in_time(self) -> None:
        if self.bypass is not None and self.clock.now() >= self.bypass["until"]:
            self._end_bypass("its longest time is over")

    def _look_at_the_clock(self) -> None:
        if step := self.clock.step():
            self.ledger.note("clock", f"the clock was set {'forward' if step > 0 else 'back'} by "
                             f"{abs(step):.1f} s", self.clock.now())
