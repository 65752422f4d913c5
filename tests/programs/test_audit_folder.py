"""A folder of recordings is a row: what is missing, exchanged, doubled or foreign shows."""

import json
import os
import shutil
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from recorded_body import measured_anew, record_body

from cell.core.errors import DocumentError
from cell.programs.audit.folder import audit_folder
from cell.programs.audit.gather import gather_logs, parse_since, read_what_if, started_since
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question
from cell.programs.audit.spread import audit_each, cluster
from cell.recording.guard import processes
from cell.recording.seal import seal_path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Four bodies without holes, sealed one after the other."""
    monkeypatch.setenv("CELL_SEAL_KEY", str(tmp_path / "absent.key"))
    logs = tmp_path / "logs"
    logs.mkdir()
    start, _ = measured_anew()
    for number, name in enumerate("abcd"):
        record_body(logs / f"{name}.rrd", holes=(),
                    start=replace(start, recording_id=name, started=1.75e9 + 86400.0 * number))
    return logs


def kinds(folder):
    return {(finding.kind, finding.file) for finding in audit_folder(folder).findings}


def test_an_untouched_folder_has_no_findings_and_a_head(folder):
    audit = audit_folder(folder)
    assert [log.name for log in audit.logs] == ["a.rrd", "b.rrd", "c.rrd", "d.rrd"]
    assert (audit.findings, audit.newest, len(audit.head)) == ((), "d.rrd.seal.json", 64)


def test_a_removed_body_is_missing(folder):
    (folder / "b.rrd").unlink()
    seal_path(folder / "b.rrd").unlink()
    assert kinds(folder) == {("missing", "b.rrd.seal.json")}


def test_a_removed_recording_is_missing_although_its_seal_is_there(folder):
    (folder / "b.rrd").unlink()
    assert kinds(folder) == {("missing", "b.rrd")}


def test_the_first_body_removed_is_missing_the_newest_shows_in_the_head_alone(folder):
    head = audit_folder(folder).head
    for name in "ad":
        (folder / f"{name}.rrd").unlink()
        seal_path(folder / f"{name}.rrd").unlink()
    assert kinds(folder) == {("missing", "a.rrd.seal.json")}
    assert audit_folder(folder).head != head


def test_exchanged_numbers_are_reordered(folder):
    one, other = (seal_path(folder / f"{name}.rrd") for name in "bc")
    renumber(one, 3)
    renumber(other, 2)
    assert {kind for kind, _ in kinds(folder)} == {"reordered"}


def test_a_copy_is_a_duplicate(folder):
    shutil.copy(folder / "b.rrd", folder / "e.rrd")
    text = seal_path(folder / "b.rrd").read_text().replace("b.rrd", "e.rrd", 1)
    seal_path(folder / "e.rrd").write_text(text)
    assert ("duplicated", "e.rrd.seal.json") in kinds(folder)


def test_two_recordings_of_one_id_are_duplicates(folder):
    start = replace(measured_anew()[0], recording_id="a", body_id="another")
    record_body(folder / "e.rrd", start=start, holes=measured_anew()[1][:1])
    assert kinds(folder) == {("duplicated", "e.rrd.seal.json")}


def test_a_stranger_is_named(folder, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    record_body(elsewhere / "x.rrd", holes=())
    for path in elsewhere.iterdir():
        shutil.copy(path, folder)
    (folder / "y.rrd.seal.json").write_text("{}")
    (folder / "z.rrd").write_bytes(b"RRF2 or so")
    assert {("foreign", "x.rrd.seal.json"), ("foreign", "y.rrd.seal.json"),
            ("unsealed", "z.rrd")} <= kinds(folder)


def test_gathering_takes_files_and_folders_and_keeps_the_row(folder, tmp_path):
    logs, folders = gather_logs([folder / "c.rrd", folder])
    assert [log.name for log in logs] == ["c.rrd", "a.rrd", "b.rrd", "d.rrd"]
    assert len(folders) == 1
    with pytest.raises(DocumentError, match="no such recording"):
        gather_logs([tmp_path / "nowhere"])


def test_since_keeps_what_began_later(folder):
    logs, _ = gather_logs([folder])
    moment = datetime.fromtimestamp(1.75e9 + 1.5 * 86400, UTC)
    assert [log.name for log in started_since(logs, moment)] == ["c.rrd", "d.rrd"]


def test_since_understands_days(monkeypatch):
    sunday = datetime(2026, 11, 22, 13, 0, tzinfo=UTC)
    assert parse_since("monday", sunday) == datetime(2026, 11, 16, tzinfo=UTC)
    assert parse_since("sunday", sunday) == datetime(2026, 11, 22, tzinfo=UTC)
    assert parse_since("2026-11-16T06:30", sunday) == datetime(2026, 11, 16, 6, 30, tzinfo=UTC)
    with pytest.raises(DocumentError, match="expected a day"):
        parse_since("lately", sunday)


def test_what_if_documents_are_read_or_refused(tmp_path):
    with pytest.raises(DocumentError, match="calibration set"):
        read_what_if(str(tmp_path / "absent"), None, None)
    with pytest.raises(DocumentError):
        read_what_if(None, tmp_path / "absent.yaml", None)
    assert not read_what_if(None, None, None).asks


def test_processes_give_the_same_answers_and_one_broken_log_does_not_stop_them(folder):
    (folder / "broken.rrd").write_bytes(b"RRF2" + os.urandom(5000))
    logs, _ = gather_logs([folder])
    question = Question(unsealed=True)
    with processes(2) as executor:
        spread = {audit.log.name: audit for audit in audit_each(logs, question, executor)}
    alone = {log.name: audit_log(log, question) for log in logs}
    assert {name: audit.answer for name, audit in spread.items()} == \
        {name: audit.answer for name, audit in alone.items()}
    assert spread["broken.rrd"].answer == "refused"
    assert spread["a.rrd"].answer == "identical"


@pytest.mark.soak
def test_a_cluster_gives_the_same_answers(folder):
    distributed = pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    logs, _ = gather_logs([folder])
    with (distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1",
                                   dashboard_address=None) as scheduler,
          cluster(scheduler.scheduler_address) as executor):
        answers = [audit.answer for audit in audit_each(logs, Question(), executor)]
    assert answers == ["identical"] * 4


def renumber(seal, number):
    content = json.loads(seal.read_text()) | {"sequence": number}
    seal.chmod(0o644)
    seal.write_text(json.dumps(content))
