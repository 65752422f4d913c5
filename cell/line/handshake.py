"""The handshake behind the registers: edges become orders, results are held until acknowledged.

Called from the server's thread (`written`, `block`) and from the shift's (everything else).
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Sequence

from cell.core.ports import Command, LineResult, LineStatus, Order, Refusal
from cell.line import registers
from cell.line.registers import (
    BODY_PRESENT,
    COMMANDS,
    FAULTS,
    FROM_CELL_SIZE,
    FROM_PLC_SIZE,
    NO_DEVIATION,
    REFUSALS,
    STATES,
    STATUS,
    VERDICTS,
    Bit,
)

SILENCE = 60.0
"""Seconds without a word from the shift after which the cell's heartbeat stops."""


class Handshake:
    """Both blocks of registers and what their changes mean."""

    def __init__(self, patience: float) -> None:
        """Count the line as lost after `patience` s without a change of the PLC's heartbeat."""
        self._from_plc, self._from_cell = [0] * FROM_PLC_SIZE, [0] * FROM_CELL_SIZE
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._lock, self._patience = threading.Lock(), patience
        self._beaten: float | None = None
        self._shown, self._status = time.monotonic(), LineStatus("starting")
        self._held: LineResult | None = None
        self._acknowledged = 0
        self._write("version", registers.VERSION)

    def written(self, address: int, words: Sequence[int]) -> None:
        """Take what the PLC has written, and act on the bits that it raised or lowered."""
        with self._lock:
            before = list(self._from_plc)
            self._from_plc[address:address + len(words)] = words
            if self._from_plc[0] != before[0]:
                self._beaten = time.monotonic()
            self._follow_commands(before)
            self._follow_body(before)

    def block(self) -> list[int]:
        """Give what the PLC reads, as one consistent block."""
        with self._lock:
            if time.monotonic() - self._shown < SILENCE:
                self._write("heartbeat", int(time.monotonic() * 2.0) & 0xFFFF)
            self._write_status()
            return list(self._from_cell)

    def show(self, status: LineStatus) -> None:
        """Show what the cell is doing."""
        with self._lock:
            self._shown, self._status = time.monotonic(), status

    def take(self, timeout: float) -> Order | None:
        """Wait for the next command."""
        try:
            return self._orders.get(timeout=timeout) if timeout > 0 else self._orders.get_nowait()
        except queue.Empty:
            return None

    def answer(self, order: Order, refusal: Refusal = "") -> None:
        """Echo a command, for as long as its bit is up."""
        with self._lock:
            if self._is_up(self._from_plc, order.command):
                self._echo(order.command, REFUSALS[refusal])

    def publish(self, result: LineResult) -> None:
        """Show a result and hold it."""
        with self._lock:
            self._held = result
            worst = NO_DEVIATION if result.worst is None else min(round(result.worst * 1000.0),
                                                                  NO_DEVIATION - 1)
            for name, value in (
                    ("sequence", result.sequence), ("body_id", result.body_id),
                    ("body_type", result.body_type), ("measured", result.measured),
                    ("out_of_tolerance", result.out_of_tolerance), ("missing", result.missing),
                    ("worst_um", worst), ("verdict", VERDICTS[result.verdict])):
                self._write(name, value)

    def acknowledged(self, sequence: int) -> bool:
        """Tell whether result `sequence` has been acknowledged."""
        with self._lock:
            return self._acknowledged == sequence

    def alive(self) -> bool:
        """Tell whether the PLC's heartbeat beats."""
        with self._lock:
            return self._is_alive()

    def _follow_commands(self, before: Sequence[int]) -> None:
        for bit in COMMANDS:
            was, now = self._is_up(before, bit), self._is_up(self._from_plc, bit)
            if was and not now:
                self._from_cell[1] &= ~(1 << COMMANDS[bit])
            elif now and not was:
                self._begin(bit)

    def _begin(self, bit: Bit) -> None:
        if bit == "acknowledge":
            self._acknowledge()
        else:
            self._orders.put(self._order(bit))

    def _follow_body(self, before: Sequence[int]) -> None:
        """A body that leaves while it is measured aborts its measurement."""
        left = before[2] & ~self._from_plc[2] & (1 << BODY_PRESENT)
        if left and self._status.busy:
            self._orders.put(Order("abort", reason="the body left the station"))

    def _order(self, command: Command) -> Order:
        read = {name: registers.read_from_plc(self._from_plc, name)
                for name in ("body_id", "body_type", "operator", "reason")}
        return Order(command, str(read["body_id"]), int(read["body_type"]),
                     str(read["operator"] or ""), str(read["reason"] or ""),
                     body_present=bool(self._from_plc[2] & (1 << BODY_PRESENT)))

    def _acknowledge(self) -> None:
        """Let the held result go, if it is the one that the PLC means."""
        meant = registers.read_from_plc(self._from_plc, "acknowledged")
        if self._held is None or self._held.sequence != meant:
            self._echo("acknowledge", REFUSALS["wrong_sequence"])
            return
        self._acknowledged, self._held = self._held.sequence, None
        for name in ("sequence", "verdict", "body_type", "measured", "out_of_tolerance", "missing"):
            self._write(name, 0)
        self._write("body_id", "")
        self._write("worst_um", NO_DEVIATION)
        self._echo("acknowledge", 0)

    def _echo(self, bit: Bit, code: int) -> None:
        self._write("answer", code)
        self._from_cell[1] |= 1 << COMMANDS[bit]

    def _write_status(self) -> None:
        status = self._status
        shown = {"ready": status.ready, "busy": status.busy, "clear": status.clear,
                 "result_valid": self._held is not None, "master_due": status.master_due,
                 "bypass": status.bypass, "trial": status.trial,
                 "line_lost": not self._is_alive()}
        self._write("status", sum(1 << STATUS[name] for name, on in shown.items() if on))
        self._write("state", STATES["fault"] if status.fault else STATES[status.state])
        self._write("fault", FAULTS[status.fault])
        for name in ("hole", "holes", "seconds_left"):
            self._write(name, getattr(status, name))

    def _is_alive(self) -> bool:
        return self._beaten is not None and time.monotonic() - self._beaten < self._patience

    def _is_up(self, block: Sequence[int], bit: Bit) -> bool:
        return bool(block[1] >> COMMANDS[bit] & 1)

    def _write(self, name: str, value: int | str) -> None:
        registers.write_for_plc(self._from_cell, name, value)
