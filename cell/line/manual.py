"""A person in the place of the PLC, and beside it: orders typed at the cell's own terminal."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable
from typing import TypeAlias

from cell.core.ports import Line, LineResult, LineStatus, Order, Refusal

Tell: TypeAlias = Callable[[str], None]

HELP = """\
  s TYPE BODY     start: measure this body
  a               abort the body
  k               acknowledge the result
  r NAME          reset: the cause is gone, the body has not moved; NAME is who says so
  b NAME REASON   let bodies pass unmeasured
  e NAME          end the bypass
  q               end the shift after this body"""


class Keyboard:
    """Reads orders line by line in a thread of its own, from a terminal or any other lines."""

    def __init__(self, lines: Iterable[str], tell: Tell) -> None:
        self._lines, self._tell = lines, tell
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self.acknowledge = threading.Event()
        self._thread = threading.Thread(target=self._read, name="keyboard", daemon=True)

    def open(self) -> None:
        """Begin to read."""
        self._tell(HELP)
        self._thread.start()

    def take(self, timeout: float) -> Order | None:
        """Wait for the next order that was typed."""
        try:
            return self._orders.get(timeout=timeout) if timeout > 0 else self._orders.get_nowait()
        except queue.Empty:
            return None

    def _read(self) -> None:
        for line in self._lines:
            if line.strip() == "k":
                self.acknowledge.set()
            elif (order := parse_order(line)) is not None:
                self._orders.put(order)
            elif line.strip():
                self._tell(f"not understood: {line.strip()}\n{HELP}")


class ManualLine:
    """The line played by a person: bodies announced and results acknowledged by hand."""

    def __init__(self, keyboard: Keyboard, tell: Tell) -> None:
        self._keyboard, self._tell = keyboard, tell
        self._held: LineResult | None = None
        self._acknowledged = 0

    def open(self) -> None:
        """Begin to read the keyboard."""
        self._keyboard.open()

    def show(self, status: LineStatus) -> None:
        """Do nothing: the screen shows it."""

    def take(self, timeout: float) -> Order | None:
        """Wait for the next order that was typed."""
        return self._keyboard.take(timeout)

    def answer(self, order: Order, refusal: Refusal = "") -> None:
        """Say why an order was refused."""
        if refusal:
            self._tell(f"{order.command} refused: {refusal.replace('_', ' ')}")

    def publish(self, result: LineResult) -> None:
        """Say the verdict and wait for `k`."""
        self._held = result
        self._keyboard.acknowledge.clear()
        self._tell(f"body {result.body_id}: {result.verdict.upper()}; acknowledge with k")

    def acknowledged(self, sequence: int) -> bool:
        """Tell whether the result `sequence` has been acknowledged."""
        if self._held is not None and self._keyboard.acknowledge.is_set():
            self._acknowledged, self._held = self._held.sequence, None
        return self._acknowledged == sequence

    def alive(self) -> bool:
        """Tell that a person needs no heartbeat."""
        return True

    def close(self) -> None:
        """Do nothing: the reading thread ends with the program."""


class LineWithKeyboard:
    """Another line, beside which a person at the cell can give orders too."""

    def __init__(self, line: Line, keyboard: Keyboard) -> None:
        self._line, self._keyboard = line, keyboard
        self._typed: list[Order] = []
        self.show, self.publish = line.show, line.publish
        self.acknowledged, self.alive, self.close = line.acknowledged, line.alive, line.close

    def open(self) -> None:
        """Open the line and begin to read the keyboard."""
        self._line.open()
        self._keyboard.open()

    def take(self, timeout: float) -> Order | None:
        """Take what was typed, else wait for the line."""
        if (order := self._keyboard.take(0.0)) is not None:
            self._typed.append(order)
            return order
        return self._line.take(timeout)

    def answer(self, order: Order, refusal: Refusal = "") -> None:
        """Answer the line's own orders; those of the keyboard are answered on the screen."""
        if order in self._typed:
            self._typed.remove(order)
        else:
            self._line.answer(order, refusal)


def parse_order(line: str) -> Order | None:
    """Understand one typed line, or None."""
    word, _, rest = line.strip().partition(" ")
    first, _, second = rest.strip().partition(" ")
    if word == "s" and first.isdigit() and second.strip():
        return Order("start", body_id=second.strip(), body_type=int(first))
    if word == "b" and first and second.strip():
        return Order("bypass", operator=first, reason=second.strip())
    if word in ("a", "q"):
        return Order("abort" if word == "a" else "stop", operator=first)
    if word in ("r", "e") and first:
        return Order("reset" if word == "r" else "end_bypass", operator=first)
    return None
