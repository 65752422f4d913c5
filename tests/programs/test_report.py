"""A report made again says what the recording says, and none is made of an altered one."""

import resource
from contextlib import contextmanager

import pytest
from recorded_body import measured_anew, record_body

from cell.core.errors import DocumentError, RecordingError
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question
from cell.programs.report import report_log
from cell.programs.results import read_rows
from cell.recording.prune import prune
from cell.recording.repair import repair
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


@contextmanager
def full_disk(most_bytes):
    """Let no file grow beyond so many bytes, as a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_no_part_of_a_report_passes_for_one(log):
    with full_disk(20_000), pytest.raises(RecordingError, match="cannot be written"):
        report_log(log)
    assert not log.with_suffix(".html").exists()


def test_a_copy_that_does_not_fit_is_no_damage_of_the_recording(log):
    with full_disk(20_000), pytest.raises(RecordingError, match=r"pruned\.rrd: cannot be written"):
        prune(log)
    assert prune(log).status == "pruned"  # nothing is left that would pass for a copy


def test_a_torn_recording_is_repaired_once_there_is_room(log):
    torn = log.with_name("torn.rrd")
    torn.write_bytes(log.read_bytes()[:-300_000])
    with full_disk(20_000):
        with pytest.raises(RecordingError, match="cannot be copied"):
            repair(torn)
        assert audit_log(torn, Question(unsealed=True)).exit_code() == 4  # no word about it
    assert (repair(torn).status, torn.exists()) == ("repaired", True)
    with pytest.raises(DocumentError, match="it was repaired before"):
        repair(torn)
    assert torn.with_name("torn.repaired.rrd").exists()
