"""One client's socket: never waited for, so that no client can hold the controller up."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable

UNREAD_BYTES = 1 << 18  # a client that leaves more unread is cut off, as by a real controller


class Connection:
    """Bytes out to one client, buffered; bytes in go to whoever `receive` is."""

    def __init__(self, link: socket.socket) -> None:
        link.setblocking(False)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket = link
        self.open = True
        self.receive: Callable[[bytes], None] = lambda _: None
        self.closed: Callable[[], None] = lambda: None
        self._unsent = bytearray()

    def send(self, data: bytes) -> None:
        """Send now what the client takes and the rest with the next call."""
        self._unsent += data
        try:
            sent = self.socket.send(self._unsent)
            del self._unsent[:sent]
        except BlockingIOError:
            pass
        except OSError:
            self.open = False
        self.open = self.open and len(self._unsent) < UNREAD_BYTES

    def read(self) -> None:
        """Hand on what came; note the client's leaving."""
        try:
            data = self.socket.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.open = False
            return
        try:
            self.receive(data)
        except (ValueError, KeyError, IndexError, ArithmeticError):
            self.open = False  # it does not speak the protocol

    def close(self) -> None:
        """End the connection."""
        self.open = False
        self.closed()
        with contextlib.suppress(OSError):
            self.socket.close()


def lines(answer: Callable[[str], str], connection: Connection) -> Callable[[bytes], None]:
    """Turn bytes into lines and answer each one."""
    received = bytearray()

    def receive(data: bytes) -> None:
        received.extend(data)
        while (end := received.find(b"\n")) >= 0:
            line = bytes(received[:end]).decode(errors="replace")
            del received[:end + 1]
            connection.send((answer(line) + "\n").encode())

    return receive
