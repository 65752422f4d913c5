"""A seal shows every later change, and says what it cannot show."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from cell.core.errors import DocumentError, RecordingError
from cell.recording.integrity import check_chain, check_images, check_seal
from cell.recording.keys import key_id, key_path, new_key, read_key, read_public_key
from cell.recording.reader import read
from cell.recording.seal import Closed, read_seal, seal_path, sealed_or_removed, write_seal
from cell.recording.writer import Recorder


@pytest.fixture
def key(tmp_path, monkeypatch):
    path = tmp_path / "keys" / "seal.key"
    monkeypatch.setenv("CELL_SEAL_KEY", str(path))
    return key_id(new_key(path).public_key())


def record(path, papers, holes=2):
    recorder = Recorder(path, papers.start())
    for index in range(holes):
        recorder.write_hole(papers.hole(index))
    recorder.finish(papers.stop(holes))
    return path


def verdicts(log, trusted=()):
    _, checks = check_seal(log, trusted)
    return {check.level: check.passed for check in checks}


def rewrite(path, change):
    path.chmod(0o644)
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | change))


def test_a_fresh_recording_passes_every_level(tmp_path, papers, key):
    first, second = (record(tmp_path / f"{name}.rrd", papers) for name in "ab")
    assert verdicts(first, [key]) == {"file": True, "signature": True, "link": True}
    assert verdicts(second, [key]) == {"file": True, "signature": True, "link": True}
    assert read_seal(seal_path(second)).previous.file == "a.rrd.seal.json"
    seal, back = read_seal(seal_path(second)), read(second)
    found = Closed(back.head, len(back.holes), back.status, back.start.recording_id)
    assert check_chain(seal, found, back.faults).passed
    for other in ({"status": "fault"}, {"holes": 1}, {"chain": "00"}, {"recording_id": "other"}):
        assert not check_chain(seal, replace(found, **other), back.faults).passed
    assert check_images(seal, back.missing).passed
    assert check_images(seal, 1).passed is False
    assert check_images(seal.model_copy(update={"status": "pruned"}), 1).passed is None


def test_without_a_key_the_seal_says_that_it_is_hashes_only(tmp_path, papers):
    log = record(tmp_path / "a.rrd", papers)
    _, checks = check_seal(log)
    assert [check.passed for check in checks] == [True, None, True]
    assert "hashes only" in checks[1].words


def test_a_recording_and_its_seal_are_read_only(tmp_path, papers):
    log = record(tmp_path / "a.rrd", papers)
    assert log.stat().st_mode & 0o222 == seal_path(log).stat().st_mode & 0o222 == 0


def test_one_changed_byte_is_an_altered_file(tmp_path, papers, key):
    log = record(tmp_path / "a.rrd", papers)
    content = bytearray(log.read_bytes())
    content[len(content) // 2] ^= 1
    log.chmod(0o644)
    log.write_bytes(content)
    assert verdicts(log, [key])["file"] is False


def test_a_renamed_recording_is_told(tmp_path, papers, key):
    log = record(tmp_path / "a.rrd", papers)
    moved = log.rename(tmp_path / "z.rrd")
    seal_path(log).rename(seal_path(moved))
    assert verdicts(moved, [key])["file"] is False


@pytest.mark.parametrize("change", [{"holes": 1}, {"status": "aborted"}, {"sequence": 2},
                                    {"signature": "00"}, {"signature": "not hex"},
                                    {"public_key": "none"}, {"key": "0" * 16}])
def test_an_edited_seal_no_longer_fits_its_signature(tmp_path, papers, key, change):
    log = record(tmp_path / "a.rrd", papers)
    rewrite(seal_path(log), change)
    assert verdicts(log, [key])["signature"] is False


def test_a_seal_by_another_key_does_not_pass_where_the_key_is_known(tmp_path, papers, key):
    log = record(tmp_path / "a.rrd", papers)
    stranger = key_id(new_key(tmp_path / "stranger.key").public_key())
    assert verdicts(log, [stranger])["signature"] is False
    assert verdicts(log, [stranger, key])["signature"] is True
    assert verdicts(log)["signature"] is None


def test_a_stripped_signature_does_not_pass_where_the_key_is_known(tmp_path, papers, key):
    log = record(tmp_path / "a.rrd", papers)
    rewrite(seal_path(log), {"signature": None, "key": None, "public_key": None})
    assert verdicts(log, [key])["signature"] is False


def test_an_exchanged_body_breaks_the_link_of_the_next(tmp_path, papers):
    first, second = (record(tmp_path / f"{name}.rrd", papers) for name in "ab")
    seal_path(first).unlink()
    assert verdicts(second)["link"] is None
    write_seal(first, Closed("0" * 64, 2, "complete", "id"), None)
    assert verdicts(second)["link"] is False


def test_a_seal_is_never_overwritten(tmp_path, papers):
    log = record(tmp_path / "a.rrd", papers)
    before = seal_path(log).read_bytes()
    with pytest.raises(RecordingError, match="sealed already"):
        write_seal(log, Closed("0" * 64, 2, "complete", "id"), None)
    assert seal_path(log).read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.rrd", "a.rrd.seal.json"]


def test_a_key_that_others_can_read_is_refused_before_anything_is_written(tmp_path, papers, key):
    Path(os.environ["CELL_SEAL_KEY"]).chmod(0o644)
    with pytest.raises(DocumentError, match="others can use this key"):
        Recorder(tmp_path / "a.rrd", papers.start())
    assert not (tmp_path / "a.rrd").exists()


def test_a_key_is_never_overwritten_and_comes_back(tmp_path, key):
    path = tmp_path / "keys" / "seal.key"
    with pytest.raises(DocumentError, match="is there already"):
        new_key(path)
    assert key_id(read_key(path).public_key()) == key
    assert key_id(read_public_key(path.with_suffix(".pub"))) == key
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_file_that_is_no_key_is_refused(tmp_path):
    path = tmp_path / "seal.key"
    path.write_text("nothing")
    path.chmod(0o600)
    with pytest.raises(DocumentError, match="Ed25519"):
        read_key(path)
    with pytest.raises(DocumentError, match="Ed25519"):
        read_public_key(path)
    assert read_key(tmp_path / "absent.key") is None


def test_an_account_without_a_home_has_no_key(monkeypatch):
    """A user id without an account, as a container has it."""
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("CELL_SEAL_KEY", raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    assert read_key(key_path()) is None


@pytest.mark.parametrize(("failure", "stays"), [
    (RecordingError("full"), False), (KeyboardInterrupt(), False),
    (DocumentError("exists already"), True)])
def test_a_copy_that_was_not_sealed_is_removed(tmp_path, failure, stays):
    copy = tmp_path / "a.repaired.rrd"
    copy.touch()
    with pytest.raises(type(failure)), sealed_or_removed(copy):
        raise failure
    assert copy.exists() == stays
