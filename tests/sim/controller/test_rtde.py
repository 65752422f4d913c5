"""The RTDE port as any client sees it: plain sockets against the emulator's process."""

import itertools
import socket
import struct
import time

import pytest

from cell.sim.controller.process import EmulatedController
from cell.sim.controller.rtde import packages


@pytest.fixture(scope="module")
def emulator():
    with EmulatedController("ur5e", speed=5.0) as running:
        yield running


class Client:
    """A bare RTDE client."""

    def __init__(self, address):
        self._link = socket.create_connection((address, 30004), timeout=10.0)
        self._received = bytearray()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._link.close()

    def send(self, kind, content=b""):
        self._link.sendall(struct.pack(">HB", 3 + len(content), ord(kind)) + content)

    def read(self):
        while True:
            for package in packages(self._received):
                return package
            data = self._link.recv(4096)
            if not data:
                raise ConnectionError
            self._received += data

    def ask(self, kind, content=b""):
        self.send(kind, content)
        while (answer := self.read())[0] != kind:
            pass
        return answer[1]


def test_it_speaks_protocol_two_and_says_its_version(emulator):
    with Client(emulator.address) as client:
        assert client.ask("V", b"\x00\x02") == b"\x01"
        assert client.ask("V", b"\x00\x01") == b"\x00"
        assert struct.unpack(">4I", client.ask("v"))[0] == 5


def test_an_unknown_output_is_named_not_found_and_nothing_is_sent(emulator):
    with Client(emulator.address) as client:
        types = client.ask("O", struct.pack(">d", 125.0) + b"timestamp,actual_mood,actual_q,")
        assert types[1:] == b"DOUBLE,NOT_FOUND,VECTOR6D"
        client.ask("S")
        client._link.settimeout(0.3)
        with pytest.raises(TimeoutError):
            client.read()


def test_the_stream_comes_at_the_rate_asked_for_with_rising_time(emulator):
    with Client(emulator.address) as client:
        client.ask("O", struct.pack(">d", 25.0) + b"timestamp,actual_q")
        client.ask("S")
        stamps = [struct.unpack_from(">d", client.read()[1], 1)[0] for _ in range(11)]
    steps = [(later - earlier) / 5.0 for earlier, later in itertools.pairwise(stamps)]
    assert min(steps) > 0.0
    assert sum(steps) / len(steps) == pytest.approx(0.04, rel=0.5)


def test_an_input_belongs_to_one_client_until_it_leaves(emulator):
    with Client(emulator.address) as first, Client(emulator.address) as second:
        assert first.ask("I", b"input_int_register_5")[0] == 1
        assert second.ask("I", b"input_int_register_5") == b"\x00IN_USE"
        first._link.close()
        deadline = time.monotonic() + 5.0
        while second.ask("I", b"input_int_register_5")[0] == 0:
            assert time.monotonic() < deadline


def test_nonsense_ends_the_connection_and_nothing_else(emulator):
    with Client(emulator.address) as rude, Client(emulator.address) as polite:
        rude.send("U", b"\x09")
        rude._link.sendall(b"\x00\x00\x00\x00")
        with pytest.raises(OSError):  # reset or closed, as it falls out
            while True:
                rude.read()
        assert polite.ask("V", b"\x00\x02") == b"\x01"


def test_the_referee_refuses_words_it_does_not_know(emulator):
    assert emulator.tell_referee("explode") == "unknown: explode"
    assert emulator.tell_referee("safeguard") == "unknown: safeguard"
