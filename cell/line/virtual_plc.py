"""A virtual PLC: a Modbus client that brings bodies to the cell and takes their verdicts away."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

from cell.core.errors import DeviceError
from cell.line import registers
from cell.line.registers import (
    COMMANDS,
    FROM_CELL_SIZE,
    REFUSALS,
    STATUS,
    VERDICTS,
    Bit,
)

PATIENCE = 3
"""Masters in a row that may fail before the virtual line stops the shift."""

LOOK = 0.02
"""Seconds between two looks at the cell."""


@dataclass(frozen=True)
class VirtualBody:
    """A body on the virtual line."""

    body_id: str
    body_type: int


@dataclass(frozen=True)
class Received:
    """What the cell answered for one body: a verdict, or a refusal."""

    body: VirtualBody
    sequence: int
    verdict: str
    refusal: str = ""


Place: TypeAlias = Callable[[VirtualBody], None]


class VirtualPlc:
    """Brings one body after the other, presents the master where it is due, acknowledges results.

    `place` is called with each body before the cell hears of it, as the skid puts it down. After a
    fault somebody presses reset `repair` seconds later.
    """

    def __init__(self, address: tuple[str, int], bodies: Iterator[VirtualBody],
                 master: VirtualBody | None, place: Place, repair: float = 1.0) -> None:
        self.received: list[Received] = []
        self.failure: Exception | None = None
        self._client = ModbusTcpClient(address[0], port=address[1], timeout=10)
        self._bodies, self._master, self._place = bodies, master, place
        self._repair = repair
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual-plc", daemon=True)

    def start(self) -> None:
        """Begin to bring bodies."""
        self._thread.start()

    def stop(self, timeout: float = 10.0) -> None:
        """Leave the line as it is."""
        self._stopping.set()
        self._thread.join(timeout)

    def _run(self) -> None:
        try:
            self._client.connect()
            try:
                self._bring_all()
            finally:
                if not self._stopping.is_set():
                    self._command("stop")
        except (ModbusException, OSError, DeviceError) as failure:
            self.failure = None if self._stopping.is_set() else failure
        finally:
            self._client.close()

    def _bring_all(self) -> None:
        for body in self._bodies:
            if not self._bring(body):
                return

    def _bring(self, body: VirtualBody) -> bool:
        """Present one body, after the master where that is due; False where the line stops."""
        masters = 0
        while not self._stopping.is_set():
            if not self._wait_for("ready", "master_due", "result_valid"):
                return False
            if self._has("result_valid"):
                self._acknowledge(VirtualBody("", 0))
            elif self._has("master_due") and self._master is not None:
                if (masters := masters + 1) > PATIENCE:
                    raise DeviceError(f"the master failed {PATIENCE} times", device="virtual PLC")
                self._present(self._master)
            else:
                self._present(body)
                return True
        return False

    def _present(self, body: VirtualBody) -> None:
        self._place(body)
        self._write("body_type", body.body_type)
        self._write("body_id", body.body_id)
        self._write("signals", 1)
        refusal = self._command("start")
        if refusal:
            self.received.append(Received(body, 0, "none", refusal))
        elif self._wait_for("result_valid"):
            self._acknowledge(body)
        self._write("signals", 0)

    def _acknowledge(self, body: VirtualBody) -> None:
        block = self._look()
        sequence = int(registers.read_from_cell(block, "sequence"))
        code = registers.read_from_cell(block, "verdict")
        verdict = next(name for name, number in VERDICTS.items() if number == code)
        found = VirtualBody(str(registers.read_from_cell(block, "body_id")),
                            int(registers.read_from_cell(block, "body_type")))
        if body.body_id and found != body:
            raise DeviceError(f"a result of {found} came for {body}", device="virtual PLC")
        self._write("acknowledged", sequence)
        self._command("acknowledge")
        self.received.append(Received(found, sequence, verdict))

    def _command(self, bit: Bit) -> str:
        """Raise a bit, wait for its echo, read the answer, lower it, see the echo go."""
        mask = 1 << COMMANDS[bit]
        self._write("commands", mask)
        block = self._until(lambda block: bool(block[1] & mask))
        code = registers.read_from_cell(block, "answer")
        self._write("commands", 0)
        self._until(lambda block: not block[1] & mask)
        return next(name for name, number in REFUSALS.items() if number == code)

    def _wait_for(self, *bits: str) -> bool:
        """Wait until one of the status bits shows; press reset after a fault. False: stopping."""
        mask = registers.bits_of(bits, STATUS)
        while not self._stopping.is_set():
            block = self._until(lambda block: bool(block[2] & mask or block[5]))
            if block[2] & mask:
                return True
            if self._stopping.wait(self._repair):
                break
            self._command("reset")
        return False

    def _until(self, met: Callable[[Sequence[int]], bool]) -> Sequence[int]:
        while not met(block := self._look()):
            if self._stopping.wait(LOOK):
                raise DeviceError("the virtual PLC was told to stop", device="virtual PLC")
        return block

    def _has(self, bit: str) -> bool:
        return bool(self._look()[2] & 1 << STATUS[bit])

    def _look(self) -> Sequence[int]:
        self._client.write_register(0, int(time.monotonic() * 4.0) & 0xFFFF)
        answer = self._client.read_input_registers(0, count=FROM_CELL_SIZE)
        if answer.isError():
            raise DeviceError(f"the cell answered {answer}", device="virtual PLC")
        return answer.registers

    def _write(self, name: str, value: int | str) -> None:
        address, words = registers.words_for_cell(name, value)
        answer = self._client.write_registers(address, words)
        if answer.isError():
            raise DeviceError(f"the cell answered {answer}", device="virtual PLC")
