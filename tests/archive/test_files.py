"""Text files: added to and read back so that a crash costs the last line at most."""

import json

import pytest

from cell.archive.files import append_line, check_writable, read_json_lines, replace_text
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


def test_the_folder_of_a_text_is_made(tmp_path):
    replace_text(tmp_path / "history" / "a.yaml", "a: 1\n")
    assert (tmp_path / "history" / "a.yaml").read_text() == "a: 1\n"
    (tmp_path / "file").touch()
    with pytest.raises(DocumentError, match="cannot be written"):
        replace_text(tmp_path / "file" / "a.yaml", "a: 1\n")


def test_what_cannot_be_written_later_is_known_before(tmp_path):
    check_writable(tmp_path / "new" / "folder", "sessions")
    assert list((tmp_path / "new" / "folder").iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(DocumentError, match="expected a folder for sessions; came a file"):
        check_writable(tmp_path / "file", "sessions")
