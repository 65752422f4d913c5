"""What a person sees of a shift: the state, the one instruction, the last bodies, the warnings."""

import pytest
from rich.console import Console
from typer.testing import CliRunner

from cell.cli.door import app
from cell.cli.shift_screen import draw, say
from cell.core.errors import DocumentError
from cell.line import registers
from cell.programs.shift.board import Board, LastBody
from cell.programs.shift.faults import ADVICE


def _seen(board, width=100, draft=""):
    console = Console(width=width, record=True, file=open("/dev/null", "w"))  # noqa: PTH123, SIM115
    try:
        console.print(draw(board, draft))
        return console.export_text()
    finally:
        console.file.close()


def test_a_body_under_measurement():
    seen = _seen(Board("early", "measuring", body_id="WVW17", body_type=3, hole=7, holes=24,
                       seconds_left=31, trial=True, busy=True))
    for words in ("MEASURING", "WVW17", "hole 7 of 24", "31 s left", "TRIAL", "shift early"):
        assert words in seen
    assert "FAULT" not in seen and "BYPASS" not in seen


def test_a_shift_that_has_stopped_shows_no_body_under_way():
    board = Board("early", "stopped", body_id="WVW17", hole=23, holes=24,
                  last=(LastBody(4, "WVW17", "in_tolerance", False),))
    assert "hole 23" not in _seen(board, draft="q") and "WVW17: in tolerance" in _seen(board)
    assert "> q" not in _seen(board, draft="q")


def test_what_is_being_typed_is_shown():
    assert "> b Ann wind_" in _seen(Board("early", "ready"), draft="b Ann wind")


@pytest.mark.parametrize("fault", ADVICE)
def test_every_fault_says_what_to_do(fault):
    board = Board("early", fault, ADVICE[fault], fault=fault, detail="joint 3 at 12 A")
    seen = " ".join(_seen(board, 200).split())
    assert fault.replace("_", " ").upper() in seen and ADVICE[fault] in seen
    assert "joint 3" in seen and "reset" in ADVICE[fault]
    assert "joint 3" in say(board)


def test_every_fault_has_a_code_of_its_own_and_advice():
    codes = registers.FAULTS
    assert set(ADVICE) == set(codes) - {""} and len(set(codes.values())) == len(codes)


def test_warnings_stand_apart():
    seen = _seen(Board("early", "bypass", bypass="window broken", line_alive=False,
                       trouble="no plant", last=(LastBody(4, "B4", "out_of_tolerance", True),)))
    for words in ("BYPASS: window broken", "heartbeat has stopped", "no plant", "B4",
                  "out of tolerance (trial)"):
        assert words in seen


def test_the_register_map_is_printed_without_gaps_or_overlaps():
    said = CliRunner().invoke(app, ["shift", "--registers"]).stdout
    for table in (registers.FROM_PLC, registers.FROM_CELL):
        covered = [a for one in table for a in range(one.address, one.address + one.size)]
        assert covered == list(range(len(covered)))
        assert all(f"  {one.name:<18}{one.meaning}" in said for one in table)
    assert "21 protective_stop" in said and "1 unknown_type" in said


def test_a_shift_needs_its_file():
    assert CliRunner().invoke(app, ["shift"]).exit_code == 2
    answer = CliRunner().invoke(app, ["shift", "absent.yaml"])
    assert isinstance(answer.exception, DocumentError)
