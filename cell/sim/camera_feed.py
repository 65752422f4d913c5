"""What the virtual camera knows of the robot: read over RTDE by a plain socket, as any client may.

It works with the embedded emulator, with URSim, and with any other UR controller.
"""

from __future__ import annotations

import socket
import struct
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cell.core.errors import DeviceError
from cell.core.geometry import Array, Transform
from cell.sim.controller.rtde import Recipe, package, packages

PORT, RATE_HZ = 30004, 125.0
PROTOCOL = struct.pack(">H", 2)
VARIABLES = ("timestamp", "actual_q", "actual_TCP_pose", "tcp_offset",
             "actual_digital_output_bits")
MM = 1000.0


@dataclass(frozen=True, eq=False)
class Reading:
    """One report of the controller: its clock (s), joints (6,), digital outputs, and the poses as
    a controller has them: metres and a rotation vector.
    """

    time: float
    joints: Array
    outputs: int
    base_from_tcp: tuple[float, ...]
    flange_from_tcp: tuple[float, ...]

    @property
    def base_from_flange(self) -> Transform:
        """Where the flange stands, whichever TCP is active; mm."""
        return _transform(self.base_from_tcp) @ _transform(self.flange_from_tcp).inverse


class ControllerFeed:
    """A connection to a controller's RTDE port that keeps the newest reading.

    A controller that goes away leaves the last pose, with all outputs low, as its relays fall.
    """

    def __init__(self, address: str, timeout: float) -> None:
        self._address, self._timeout = address, timeout
        self._received = bytearray()
        self._socket: socket.socket | None = None
        self._recipe = Recipe((), (), 1)
        self._count = 0
        self.reading: Reading | None = None

    def open(self) -> None:
        """Connect and have the controller report; DeviceError if it does not."""
        self.close()
        try:
            self._socket = socket.create_connection((self._address, PORT), self._timeout)
            self._negotiate()
            self._socket.setblocking(False)
        except (OSError, ValueError, struct.error) as error:
            self.close()
            raise DeviceError(f"no RTDE from the controller at {self._address}:{PORT}: {error}",
                              device="simulated camera") from None

    def close(self) -> None:
        """Leave the controller."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self._received.clear()

    @property
    def connected(self) -> bool:
        """Whether the controller is there."""
        return self._socket is not None

    def fileno(self) -> int:
        """Return the socket's number, to wait for reports."""
        return self._socket.fileno() if self._socket is not None else -1

    def follow(self) -> list[Reading]:
        """Take all reports that have come, without waiting."""
        readings = []
        try:
            while chunk := self._chunk():
                self._received += chunk
            for kind, content in packages(self._received):
                if kind == "U":
                    readings.append(_reading(self._recipe.unpack(content)))
        except (OSError, ValueError, struct.error):
            self._gone()
        if readings:
            self.reading = readings[-1]
            self._count += len(readings)
        return readings

    def renew(self, deadline: float) -> list[Reading]:
        """Wait for a report that was sent after this call; none if the controller has gone."""
        readings = self.follow()
        seen = self._count
        while self.connected and self._count == seen and time.monotonic() < deadline:
            time.sleep(0.001)
            readings += self.follow()
        if self._count == seen:
            self._gone()
        return readings

    def _chunk(self) -> bytes:
        """Receive what is there: nothing if there is nothing yet."""
        if self._socket is None:
            return b""
        try:
            chunk = self._socket.recv(65536)
        except BlockingIOError:
            return b""
        if not chunk:
            raise ConnectionError("closed by the controller")
        return chunk

    def _gone(self) -> None:
        self.close()
        if self.reading is not None:
            self.reading = replace(self.reading, outputs=0)

    def _negotiate(self) -> None:
        if self._ask("V", PROTOCOL) != b"\x01":
            raise ValueError("it does not speak protocol version 2")
        wanted = struct.pack(">d", RATE_HZ) + ",".join(VARIABLES).encode()
        types = tuple(self._ask("O", wanted)[1:].decode().split(","))
        self._recipe = Recipe(VARIABLES, types, 1)
        if not self._recipe.known:
            raise ValueError(f"it does not report {dict(zip(VARIABLES, types, strict=False))}")
        if self._ask("S", b"") != b"\x01":
            raise ValueError("it does not start to report")

    def _ask(self, kind: str, content: bytes) -> bytes:
        """Send one request and wait for its answer, skipping texts and reports."""
        if self._socket is None:
            raise ConnectionError("not connected")
        self._socket.sendall(package(kind, content))
        while True:
            for answered, answer in packages(self._received):
                if answered == kind:
                    return answer
            chunk = self._socket.recv(65536)
            if not chunk:
                raise ConnectionError("closed by the controller")
            self._received += chunk


def _reading(values: dict[str, Any]) -> Reading:
    return Reading(values["timestamp"], np.array(values["actual_q"]),
                   values["actual_digital_output_bits"], values["actual_TCP_pose"],
                   values["tcp_offset"])


def _transform(pose: tuple[float, ...]) -> Transform:
    vector = np.array(pose)
    return Transform.from_parts(vector[3:], MM * vector[:3])
