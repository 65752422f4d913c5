import os
import re
from pathlib import Path

import pytest

from cell.archive.logs import check_logs, choose_log, new_log
from cell.core.errors import DocumentError
from cell.recording.audit_picture import SUFFIX


def test_a_log_is_named_by_time_and_chance(tmp_path):
    names = {new_log(tmp_path / "logs", "demo").name for _ in range(20)}
    assert len(names) == 20
    assert all(re.fullmatch(r"demo_\d{4}-\d\d-\d\dT\d{6}Z_[0-9a-f]{8}\.rrd", name)
               for name in names)


def test_trying_the_folder_leaves_nothing_in_it(tmp_path):
    check_logs(tmp_path / "a" / "logs")
    assert list((tmp_path / "a" / "logs").iterdir()) == []


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "logs").write_text("")
    with pytest.raises(DocumentError, match="logs: expected a folder"):
        check_logs(tmp_path / "logs")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    tmp_path.chmod(0o555)
    with pytest.raises(DocumentError, match="cannot be written"):
        check_logs(tmp_path / "logs")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="this system has no /proc")
def test_a_folder_that_takes_no_files_is_refused():
    with pytest.raises(DocumentError, match="recordings cannot be written here"):
        check_logs(Path("/proc/self/fdinfo"))


def test_a_disk_without_room_for_a_megabyte_is_refused(tmp_path):
    """The limit on a file's size stands for the full disk: the same write fails."""
    resource = pytest.importorskip("resource", reason="this system has no limits to set")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, before[1]))
    try:
        with pytest.raises(DocumentError, match="cannot be written here: File too large"):
            check_logs(tmp_path / "logs")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list((tmp_path / "logs").iterdir()) == []


def test_of_a_folder_the_newest_recording_is_meant(tmp_path):
    for age, name in enumerate(("b.rrd", "a.rrd", "c.html", f"a{SUFFIX}")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (age, age))
    assert choose_log(tmp_path) == tmp_path / "a.rrd"
    assert choose_log(tmp_path / "b.rrd") == tmp_path / "b.rrd"


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(DocumentError, match="no recording"):
        choose_log(tmp_path)
