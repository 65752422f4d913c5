"""A report made again says what the recording says, and none is made of an altered one."""

import pytest
from recorded_body import measured_anew, record_body

from cell.core.errors import DocumentError
from cell.programs.report import report_log
from cell.programs.results import read_rows
from cell.recording.prune import prune
from cell.recording.seal import seal_path


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.setenv("CELL_SEAL_KEY", str(tmp_path / "absent.key"))
    return record_body(tmp_path / "body.rrd")


def alter(log):
    content = bytearray(log.read_bytes())
    content[content.find(measured_anew()[1][0].outcome.centre.tobytes()) + 3] ^= 1
    log.chmod(0o644)
    log.write_bytes(content)


def test_a_report_is_made_of_an_intact_recording_alone(log):
    diameter = measured_anew()[1][0].outcome.diameter
    assert f"{diameter:.3f}" in report_log(log).read_text()
    alter(log)
    with pytest.raises(DocumentError, match="not as it was recorded: altered: its sha256"):
        report_log(log)
    seal_path(log).unlink()
    for make in (report_log, read_rows):
        with pytest.raises(DocumentError, match="does not follow"):
            make(log)


def test_a_pruned_recording_is_reported_without_pictures(log):
    page = report_log(log.with_name(prune(log).file)).read_text()
    assert "QP2" in page
    assert "data:image" not in page
