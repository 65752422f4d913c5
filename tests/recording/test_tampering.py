"""What the vendor's own tools can do to a recording is found by the chain, without any seal."""

import json
import os

import pytest
from rerun.chunk import LazyChunkStream

from cell.core.errors import DocumentError
from cell.recording.integrity import check_seal
from cell.recording.reader import read
from cell.recording.rows import open_chunks
from cell.recording.seal import read_seal, reference, seal_path
from cell.recording.writer import Recorder

RING, LASER = "/camera/ring", "/camera/laser"
OTHER = {RING: LASER, LASER: RING}


@pytest.fixture
def log(tmp_path, papers):
    recorder = Recorder(tmp_path / "a.rrd", papers.start())
    for index in range(2):
        recorder.write_hole(papers.hole(index))
    recorder.finish(papers.stop(2))
    return recorder.path


def rebuild(log, change):
    """Write it anew, each chunk replaced by those that `change` makes of it, and read it."""
    with open_chunks(log) as chunks:
        changed = [each for chunk in chunks for each in change(chunk)]
    copy = log.with_name("copy.rrd")
    LazyChunkStream.from_iter(iter(changed)).write_rrd(str(copy), application_id="cell",
                                                       recording_id="id")
    return read(copy)


def test_rebuilding_alone_changes_nothing(log):
    back = rebuild(log, lambda chunk: [chunk])
    assert (back.faults, back.missing, back.head) == ((), 0, read(log).head)


def test_images_under_the_other_light_are_named(log):
    back = rebuild(log, lambda chunk: [chunk.with_entity_path(
        OTHER.get(chunk.entity_path, chunk.entity_path))])
    assert back.faults[0] == "an image of hole H0 does not belong at /camera/laser"


def test_an_image_twice_is_named(log):
    back = rebuild(log, lambda chunk: [chunk, chunk] if chunk.entity_path == RING else [chunk])
    assert set(back.faults) == {"an image of hole H0 does not belong at /camera/ring",
                                "an image of hole H1 does not belong at /camera/ring"}


def test_absent_images_are_counted(log):
    back = rebuild(log, lambda chunk: [] if chunk.entity_path == LASER else [chunk])
    assert (back.faults, back.missing) == ((), 2)


@pytest.mark.parametrize("name", ["../a.rrd", "/dev/zero", "", ".."])
def test_a_seal_names_files_of_its_own_folder_only(log, name):
    path = seal_path(log)
    path.chmod(0o644)
    previous = {"file": name, "sha256": "0"}
    path.write_text(json.dumps(json.loads(path.read_text()) | {"previous": previous}))
    with pytest.raises(DocumentError, match=r"previous\.file: is not a seal: .*same folder"):
        read_seal(path)


def test_what_is_no_file_is_refused_and_not_waited_for(log):
    os.mkfifo(log.with_name("pipe.rrd"))
    for path in (log.with_name("pipe.rrd"), log.parent):
        with pytest.raises(DocumentError, match="is not a file"):
            reference(path)
        with pytest.raises(DocumentError, match="is not a file"):
            read(path)
    seal_path(log).unlink()
    os.mkfifo(seal_path(log))
    _, checks = check_seal(log)
    assert "is not a file" in checks[0].words
