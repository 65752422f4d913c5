"""The register map from outside: a client that knows the printed numbers and nothing else."""

import socket
import time

import pytest
from pymodbus.client import ModbusTcpClient

from cell.core.errors import DeviceError
from cell.core.ports import LineResult, LineStatus
from cell.line.modbus import ModbusLine

HEARTBEAT, COMMANDS, SIGNALS, TYPE, ACKNOWLEDGED, OPERATOR, REASON, BODY = 0, 1, 2, 3, 4, 6, 7, 8
START, ABORT, ACKNOWLEDGE, RESET, BYPASS, END_BYPASS, STOP = (1 << bit for bit in range(7))
ECHO, STATUS, STATE, ANSWER, FAULT = 1, 2, 3, 4, 5
READY, BUSY, CLEAR, VALID, MASTER_DUE, BYPASSED, TRIAL, LINE_LOST = (1 << b for b in range(8))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Plc:
    """A handful of register numbers, as an electrician has them on a sheet of paper."""

    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port, timeout=10)
        assert self.client.connect()

    def write(self, address, *words):
        answer = self.client.write_registers(address, list(words))
        assert not answer.isError()

    def read(self):
        answer = self.client.read_input_registers(0, count=28)
        assert not answer.isError()
        return answer.registers

    def announce(self, body, body_type):
        raw = body.encode().ljust(20, b"\0")
        self.write(BODY, *(raw[i] << 8 | raw[i + 1] for i in range(0, 20, 2)))
        self.write(TYPE, body_type)
        self.write(SIGNALS, 1)


@pytest.fixture
def line():
    found = ModbusLine("127.0.0.1", free_port(), patience=1.0)
    found.open()
    yield found
    found.close()


@pytest.fixture
def plc(line):
    found = Plc(line._port)
    yield found
    found.client.close()


def _result(sequence=70_001, **changes):
    return LineResult(**{"sequence": sequence, "body_id": "WVWZZZ1KZAW000001", "body_type": 3,
                         "verdict": "nok", "measured": 22, "out_of_tolerance": 2, "missing": 1,
                         "worst": 1.2344} | changes)


def test_a_fresh_cell_shows_no_verdict_and_is_not_ready(plc):
    block = plc.read()
    assert block[STATE] == 1 and block[12] == 0 and block[ECHO] == 0
    assert not block[STATUS] & (READY | VALID) and block[STATUS] & LINE_LOST
    assert block[9] == 1


def test_a_start_is_taken_once_at_its_edge_with_its_body(line, plc):
    plc.announce("WVWZZZ1KZAW000001", 3)
    plc.write(COMMANDS, START)
    plc.write(COMMANDS, START)
    order = line.take(5.0)
    assert (order.command, order.body_id, order.body_type) == ("start", "WVWZZZ1KZAW000001", 3)
    assert order.body_present and line.take(0.0) is None
    assert plc.read()[ECHO] == 0, "the echo waits for the cell's answer"
    line.answer(order)
    assert plc.read()[ECHO] == START and plc.read()[ANSWER] == 0
    plc.write(COMMANDS, 0)
    assert plc.read()[ECHO] == 0
    plc.write(COMMANDS, START)
    assert line.take(5.0) == order


def test_a_refusal_has_a_code_and_no_verdict(line, plc):
    plc.announce("B1", 99)
    plc.write(COMMANDS, START)
    line.answer(line.take(5.0), "unknown_type")
    block = plc.read()
    assert (block[ECHO], block[ANSWER], block[12]) == (START, 1, 0)


def test_a_result_is_held_until_its_own_sequence_is_acknowledged(line, plc):
    line.publish(_result())
    for _ in range(3):
        block = plc.read()
        assert block[STATUS] & VALID and block[10:18] == [1, 4465, 2, 3, 22, 2, 1, 1234]
    assert bytes(b for word in block[18:28] for b in divmod(word, 256)) \
        == b"WVWZZZ1KZAW000001\0\0\0"
    plc.write(ACKNOWLEDGED, 1, 4464)
    plc.write(COMMANDS, ACKNOWLEDGE)
    block = plc.read()
    assert (block[ECHO], block[ANSWER]) == (ACKNOWLEDGE, 8) and block[STATUS] & VALID
    assert not line.acknowledged(70_001)
    plc.write(COMMANDS, 0)
    plc.write(ACKNOWLEDGED, 1, 4465)
    plc.write(COMMANDS, ACKNOWLEDGE)
    block = plc.read()
    assert (block[ECHO], block[ANSWER]) == (ACKNOWLEDGE, 0) and line.acknowledged(70_001)
    assert not block[STATUS] & VALID and block[10:13] == [0, 0, 0] and block[17] == 65535
    assert line.take(0.0) is None, "acknowledging is no order"


@pytest.mark.parametrize(("verdict", "code"), [("ok", 1), ("nok", 2), ("uncertain", 3),
                                               ("incomplete", 4)])
def test_verdicts_have_codes_of_which_none_is_zero(line, plc, verdict, code):
    line.publish(_result(verdict=verdict, worst=None))
    assert plc.read()[12] == code and plc.read()[17] == 65535


def test_an_enormous_deviation_does_not_wrap_round(line, plc):
    line.publish(_result(worst=1e6))
    assert plc.read()[17] == 65534


def test_the_status_shows_what_the_cell_does(line, plc):
    line.show(LineStatus("measuring", busy=True, clear=False, trial=True, hole=7, holes=24,
                         seconds_left=31))
    block = plc.read()
    assert block[STATE] == 3 and block[6:9] == [7, 24, 31]
    assert block[STATUS] & (READY | BUSY | CLEAR | TRIAL) == BUSY | TRIAL
    line.show(LineStatus("protective_stop", fault="protective_stop"))
    assert plc.read()[STATE] == 8 and plc.read()[FAULT] == 21


def test_heartbeats_both_ways(line, plc):
    assert not line.alive()
    plc.write(HEARTBEAT, 1)
    assert line.alive() and not plc.read()[STATUS] & LINE_LOST
    first = plc.read()[0]
    time.sleep(1.1)
    assert plc.read()[0] != first
    assert not line.alive() and plc.read()[STATUS] & LINE_LOST
    plc.write(HEARTBEAT, 1)
    assert not line.alive(), "the same number again is no beat"
    plc.write(HEARTBEAT, 2)
    assert line.alive()


def test_the_heartbeat_stops_when_the_shift_hangs(line, plc, monkeypatch):
    monkeypatch.setattr("cell.line.handshake.SILENCE", 0.0)
    first = plc.read()[0]
    time.sleep(1.1)
    assert plc.read()[0] == first


def test_a_body_that_leaves_while_it_is_measured_aborts(line, plc):
    plc.announce("B1", 1)
    plc.write(SIGNALS, 0)
    assert line.take(0.0) is None
    plc.write(SIGNALS, 1)
    line.show(LineStatus("measuring", busy=True))
    plc.write(SIGNALS, 0)
    order = line.take(5.0)
    assert (order.command, order.reason) == ("abort", "the body left the station")
    line.answer(order)
    assert plc.read()[ECHO] == 0, "what the PLC did not command is not echoed"


def test_a_bypass_says_who_and_why(line, plc):
    plc.write(OPERATOR, 4711)
    plc.write(REASON, 12)
    plc.write(COMMANDS, BYPASS)
    order = line.take(5.0)
    assert (order.command, order.operator, order.reason) == ("bypass", "4711", "12")


def test_several_commands_at_once_are_each_taken(line, plc):
    plc.write(COMMANDS, ABORT | RESET | STOP | END_BYPASS)
    assert {line.take(5.0).command for _ in range(4)} == {"abort", "reset", "stop", "end_bypass"}


def test_registers_outside_of_the_map_are_refused(plc):
    assert plc.client.read_input_registers(0, count=29).isError()
    assert plc.client.write_registers(17, [1, 1]).isError()
    assert plc.client.write_coils(0, [True]).isError() or plc.read()[ECHO] == 0


def test_a_lost_connection_keeps_the_result(line, plc):
    line.publish(_result())
    plc.client.close()
    again = Plc(line._port)
    assert again.read()[STATUS] & VALID and again.read()[10:12] == [1, 4465]
    again.client.close()


def test_a_taken_port_is_named_and_a_closed_one_is_free_again(line):
    second = ModbusLine("127.0.0.1", line._port)
    with pytest.raises(DeviceError, match=f"cannot listen on 127.0.0.1:{line._port}"):
        second.open()
    second.close()
    line.close()
    line.close()
    third = ModbusLine("127.0.0.1", line._port)
    third.open()
    third.close()
