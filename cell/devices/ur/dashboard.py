"""The dashboard server of a UR controller: a line asked, a line answered, over a plain socket."""

from __future__ import annotations

import contextlib
import socket
import threading

from cell.core.errors import DeviceError

PORT = 29999
TIMEOUT = 2.0  # s, for each connection and each answer


class Dashboard:
    """Questions and orders to the controller. Connects by itself, again after a lost connection."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._link: socket.socket | None = None
        self._received = b""
        self._lock = threading.Lock()

    def ask(self, command: str) -> str:
        """Send one command and return its answer; DeviceError if none comes in time."""
        with self._lock:
            try:
                return self._exchange(command)
            except OSError:
                self._disconnect()  # a connection that broke while it lay idle: once more, anew
            try:
                return self._exchange(command)
            except OSError as error:
                self._disconnect()
                raise DeviceError(f"the dashboard at {self._address}:{PORT} does not answer "
                                  f"`{command}`: {error}", device="robot") from error

    def close(self) -> None:
        """Give the connection up."""
        with self._lock:
            self._disconnect()

    def _exchange(self, command: str) -> str:
        if self._link is None:
            self._link = socket.create_connection((self._address, PORT), timeout=TIMEOUT)
            self._read_line()  # the greeting
        self._link.sendall(command.encode() + b"\n")
        return self._read_line()

    def _read_line(self) -> str:
        assert self._link is not None
        while b"\n" not in self._received:
            data = self._link.recv(4096)
            if not data:
                raise ConnectionError("connection closed")
            self._received += data
        line, self._received = self._received.split(b"\n", 1)
        return line.decode(errors="replace").strip()

    def _disconnect(self) -> None:
        self._received = b""
        if self._link is not None:
            with contextlib.suppress(OSError):
                self._link.close()
            self._link = None
