"""Text files: added to and read back so that a crash costs the last line at most."""

import json

import pytest

from cell.archive.files import append_line, read_json_lines
from cell.core.errors import DocumentError


def test_lines_come_back_as_they_were_added(tmp_path):
    file = tmp_path / "log" / "lines.jsonl"
    assert read_json_lines(file) == []
    lines = [json.dumps({"number": number, "words": "größer"}) for number in range(3)]
    for line in lines:
        append_line(file, line)
    assert read_json_lines(file) == lines


@pytest.mark.parametrize("torn", ['{"number"', '{"number": {"one": 1}', '{"number": 1}'])
def test_a_line_that_was_cut_short_is_left_out_and_spoils_no_other(tmp_path, torn):
    """Cut inside an inner mapping it begins and ends like a whole one; cut at its end it is one."""
    file = tmp_path / "lines.jsonl"
    append_line(file, '{"number": 0}')
    with file.open("a") as stream:
        stream.write(torn)
    append_line(file, '{"number": 2}')
    whole = ['{"number": 1}'] if torn == '{"number": 1}' else []
    assert read_json_lines(file) == ['{"number": 0}', *whole, '{"number": 2}']


def test_what_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "log").write_text("a file")
    with pytest.raises(DocumentError, match="cannot be written"):
        append_line(tmp_path / "log" / "lines.jsonl", "{}")
