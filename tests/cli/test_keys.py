"""Single keys at a terminal of its own: read, echoed by nobody, and the terminal given back."""

import os
import pty
import select
import termios
import threading
import time

import pytest
from rich.console import Console

from cell.cli.calibrate_operator import TerminalOperator
from cell.cli.keys import Keys
from cell.core.errors import DocumentError


@pytest.fixture
def terminal():
    """A terminal: the person's end, and the program's."""
    person, program = pty.openpty()
    with os.fdopen(program, "r") as stream:
        yield person, stream
    os.close(person)


def waits_for_lines(stream):
    return bool(termios.tcgetattr(stream.fileno())[3] & termios.ICANON)


def test_keys_come_one_by_one_and_arrows_do_not_count(terminal):
    person, stream = terminal
    with Keys(stream) as keys:
        assert keys.pressed() is None and not waits_for_lines(stream)
        os.write(person, "p\x1b[Aü".encode())
        assert [keys.pressed(1.0), keys.pressed(1.0), keys.pressed()] == ["p", "ü", None]
    assert waits_for_lines(stream) and keys.pressed() is None
    assert waits_for_lines(stream)


def test_the_terminal_is_given_back_whatever_happens(terminal):
    _, stream = terminal
    before = termios.tcgetattr(stream.fileno())
    with pytest.raises(KeyboardInterrupt), Keys(stream) as keys:
        keys.pressed()
        raise KeyboardInterrupt
    assert termios.tcgetattr(stream.fileno()) == before


@pytest.mark.parametrize("looked", [False, True])
def test_a_terminal_that_is_lost_presses_no_key_and_stops_nobody(looked):
    person, program = pty.openpty()
    with os.fdopen(program, "r") as stream, Keys(stream) as keys:
        if looked:
            keys.pressed()
        os.close(person)
        assert keys.pressed() is None
        assert list(keys.lines()) == []
        keys.rest()


def test_what_was_typed_before_a_question_is_no_answer_to_it(terminal):
    person, stream = terminal
    with Keys(stream) as keys:
        keys.pressed()
        os.write(person, b"yyy")
        select.select([stream], [], [], 5.0)  # it has arrived
        keys.rest()
        assert waits_for_lines(stream)
        assert keys.pressed(0.05) is None


def test_lines_are_put_together_and_can_be_corrected(terminal):
    person, stream = terminal
    with Keys(stream) as keys:
        lines = keys.lines()
        os.write(person, b"b Ann windowx\x7f\nfalse\x15k\n")
        assert [next(lines), next(lines)] == ["b Ann window", "k"]
        os.write(person, b"r An")
        reader = threading.Thread(target=lambda: next(lines, None))
        reader.start()
        deadline = time.monotonic() + 5.0
        while keys.draft != "r An" and time.monotonic() < deadline:
            time.sleep(0.01)
        assert keys.draft == "r An"
        keys.close()
        reader.join(5.0)
        assert not reader.is_alive()


def test_without_a_terminal_nobody_presses_a_key(tmp_path):
    (tmp_path / "answers").write_text("perhaps\nyes\n")
    with (tmp_path / "answers").open() as stream, Keys(stream) as keys:
        assert not keys.here and keys.pressed(5.0) is None and list(keys.lines()) == []


def test_a_question_is_asked_until_it_is_answered(monkeypatch):
    said = Console(record=True, width=80, file=open(os.devnull, "w"))  # noqa: SIM115, PTH123
    answers = iter(["perhaps", "y", "re", "s", "skip", ""])
    monkeypatch.setattr("builtins.input", lambda *_: next(answers))
    with said.file, Keys() as keys:
        operator = TerminalOperator(said, keys)
        assert operator.confirm("Is the way clear?")
        assert operator.choose("view 7", ("retake", "skip", "stop")) == "retake"
        assert operator.choose("view 8", ("retake", "skip", "stop")) == "skip"
        assert operator.ask("Why?", "so") == "so"
        monkeypatch.setattr("builtins.input", lambda *_: (_ for _ in ()).throw(EOFError))
        with pytest.raises(DocumentError, match="nobody answers"):
            operator.ask("Why?")
        assert "Please answer yes or no." in said.export_text()
