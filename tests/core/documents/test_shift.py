"""The shift's file: what it means, and how it is refused."""

from pathlib import Path

import pytest

from cell.core.documents.shift import ShiftDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError

DEMO = (Path(__file__).parents[3] / "jobs" / "demo_shift.yaml").read_text()


def test_the_demo_shift_knows_its_jobs():
    shift = parse(ShiftDocument, DEMO, "demo_shift.yaml")
    assert shift.job_of(1) == "demo.yaml" and shift.job_of(9) == "demo.yaml"
    assert shift.job_of(2) is None and shift.is_master(9) and not shift.is_master(1)
    assert shift.line.address == "127.0.0.1", "nothing listens to the world unless told to"


@pytest.mark.parametrize(("old", "new", "words"), [
    ("type: 1,", "type: 9,", "named once"), ("minor", "critical", "never dropped"),
    ("type: 1,", "type: 0,", "type"), ("modbus", "carrier pigeon", "driver"),
    ("port: 5020", "port: 70000", "port"), ("every: 50", "evry: 50", "evry"),
    ("seconds: 150.0", "seconds: -1", "seconds")])
def test_a_wrong_shift_is_refused_with_its_place(old, new, words):
    assert old in DEMO
    with pytest.raises(DocumentError, match=words):
        parse(ShiftDocument, DEMO.replace(old, new, 1), "demo_shift.yaml")
