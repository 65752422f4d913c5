"""The register map between the PLC and the cell, in one table, and the codes that travel in it.

The PLC writes the holding registers (function codes 3, 6, 16), the cell the input registers (4).
Numbers of two registers have the high word first; text is ASCII, two characters a register, the
first in the high byte, filled with zeros. `cell shift --registers` prints this table.

Handshake. A command is a bit of `commands`: the PLC puts the data in place, raises the bit, waits
until the cell shows the same bit in `echo`, reads `answer` (0: accepted, else why not), and lowers
the bit; the cell then lowers its echo. A result stands from `result_valid` on, unchanged, until the
PLC writes its `sequence` to `acknowledged` and raises `acknowledge`. Read `status` first and the
result after it. Without `result_valid` there is no verdict: `verdict` is 0, which is not OK.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from cell.core.ports import Command, Fault, LineVerdict, Refusal

VERSION = 1
NO_DEVIATION = 65535
"""`worst_um` where nothing was measured."""


@dataclass(frozen=True)
class Register:
    """One entry of the map: its first register and how many it takes."""

    name: str
    address: int
    meaning: str
    kind: Literal["number", "long", "bits", "text"] = "number"
    size: int = 1


FROM_PLC = (
    Register("heartbeat", 0, "changes at least once a second"),
    Register("commands", 1, "bits, see COMMANDS", "bits"),
    Register("signals", 2, "bit 0: a body is present and clamped", "bits"),
    Register("body_type", 3, "type of the body, before start"),
    Register("acknowledged", 4, "sequence of the result that is acknowledged", "long", 2),
    Register("operator", 6, "number of the person who asks for the bypass or resets"),
    Register("reason", 7, "reason of the bypass, a number of the shift's list"),
    Register("body_id", 8, "number of the body (VIN), before start", "text", 10),
)
FROM_CELL = (
    Register("heartbeat", 0, "changes at least once a second"),
    Register("echo", 1, "the command bits as seen, see COMMANDS", "bits"),
    Register("status", 2, "bits, see STATUS", "bits"),
    Register("state", 3, "see STATES"),
    Register("answer", 4, "0: the last command was accepted, else see REFUSALS"),
    Register("fault", 5, "0: none, else see FAULTS"),
    Register("hole", 6, "holes done on this body"),
    Register("holes", 7, "holes to be done on this body"),
    Register("seconds_left", 8, "estimate for this body"),
    Register("version", 9, "of this map"),
    Register("sequence", 10, "number of the result below", "long", 2),
    Register("verdict", 12, "0: none, else see VERDICTS"),
    Register("body_type", 13, "type of the body that the result belongs to"),
    Register("measured", 14, "holes measured"),
    Register("out_of_tolerance", 15, "holes out of tolerance"),
    Register("missing", 16, "holes not measured"),
    Register("worst_um", 17, "largest deviation in micrometres, 65535: none"),
    Register("body_id", 18, "number of the body that the result belongs to", "text", 10),
)

Bit: TypeAlias = Command | Literal["acknowledge"]
COMMANDS: dict[Bit, int] = {
    "start": 0, "abort": 1, "acknowledge": 2, "reset": 3, "bypass": 4, "end_bypass": 5, "stop": 6}
BODY_PRESENT = 0
STATUS = {"ready": 0, "busy": 1, "clear": 2, "result_valid": 3, "master_due": 4, "bypass": 5,
          "trial": 6, "line_lost": 7}
STATES = {"starting": 1, "ready": 2, "measuring": 3, "result": 4, "bypass": 5, "master_due": 6,
          "stopped": 7, "fault": 8}
VERDICTS: dict[LineVerdict, int] = {"ok": 1, "nok": 2, "uncertain": 3, "incomplete": 4}
REFUSALS: dict[Refusal | Literal["wrong_sequence"], int] = {
    "": 0, "unknown_type": 1, "no_body": 2, "no_body_id": 3, "not_ready": 4, "master_due": 5,
    "result_held": 6, "nothing_to_do": 7, "wrong_sequence": 8, "not_named": 9}
FAULTS: dict[Fault, int] = {
    "": 0, "protective_stop": 21, "safeguard_stop": 22, "emergency_stop": 23, "local_mode": 24,
    "paused": 25, "robot_lost": 26, "robot_failed": 27, "camera_lost": 31,
    "lights_lost": 32, "laser_dark": 33, "disk_full": 41, "recording_failed": 42,
    "results_lost": 43, "holes_refused": 51, "datum_missing": 52, "master_failed": 53}

FROM_PLC_SIZE = max(r.address + r.size for r in FROM_PLC)
FROM_CELL_SIZE = max(r.address + r.size for r in FROM_CELL)

_PLC = {register.name: register for register in FROM_PLC}
_CELL = {register.name: register for register in FROM_CELL}


def read_from_plc(block: Sequence[int], name: str) -> int | str:
    """Read one entry of the block that the PLC writes."""
    return _read(block, _PLC[name])


def read_from_cell(block: Sequence[int], name: str) -> int | str:
    """Read one entry of the block that the cell writes."""
    return _read(block, _CELL[name])


def write_for_plc(block: list[int], name: str, value: int | str) -> None:
    """Write one entry of the block that the cell writes, for the PLC to read."""
    _write(block, _CELL[name], value)


def words_for_cell(name: str, value: int | str) -> tuple[int, list[int]]:
    """Give the address and the words with which a PLC writes one entry."""
    register = _PLC[name]
    return register.address, _words(register, value)


def bits_of(names: Sequence[str], table: dict[str, int]) -> int:
    """Put the bits of `names` into one word."""
    return sum(1 << table[name] for name in names)


def _read(block: Sequence[int], register: Register) -> int | str:
    words = block[register.address:register.address + register.size]
    if register.kind == "text":
        raw = b"".join(word.to_bytes(2, "big") for word in words)
        return raw.split(b"\0")[0].decode("ascii", errors="replace").strip()
    return int.from_bytes(b"".join(word.to_bytes(2, "big") for word in words), "big")


def _write(block: list[int], register: Register, value: int | str) -> None:
    block[register.address:register.address + register.size] = _words(register, value)


def _words(register: Register, value: int | str) -> list[int]:
    size = 2 * register.size
    if isinstance(value, str):
        raw = value.encode("ascii", errors="replace")[:size].ljust(size, b"\0")
    else:
        raw = min(max(value, 0), 256**size - 1).to_bytes(size, "big")
    return [int.from_bytes(raw[at:at + 2], "big") for at in range(0, size, 2)]
