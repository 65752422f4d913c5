"""Cut anywhere, a recording is read to its last whole hole; changed anywhere, it is found out."""

from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack

import numpy as np
import pytest
from recorded_body import abort

from cell.core.errors import DocumentError
from cell.recording.guard import guarded, processes
from cell.recording.integrity import check_seal
from cell.recording.pages import read_pages
from cell.recording.reader import read
from cell.recording.repair import repair
from cell.recording.seal import seal_path
from cell.recording.writer import Recorder

HOLES = 6


@pytest.fixture
def recorded(tmp_path, papers):
    """A small recording, the length of the file after each record, and the links of its chain."""
    recorder = Recorder(tmp_path / "a.rrd", papers.start())
    lengths = [recorder.path.stat().st_size]
    for index in range(HOLES):
        recorder.write_hole(papers.hole(index, views=2 + 2 * (index % 2)))
        recorder.wait()
        lengths.append(recorder.path.stat().st_size)
    recorder.finish(papers.stop(HOLES))
    return recorder.path, lengths, [page.chain for page in read_pages(recorder.path)]


def cut(recorded, length):
    """Read what is left of the recording when it is cut: (whole holes, faults)."""
    path, _, chains = recorded
    torn = path.with_name("torn.rrd")
    torn.write_bytes(path.read_bytes()[:length])
    try:
        back = read(torn)
    except DocumentError as error:
        assert "start record" in str(error) or "not a recording" in str(error)
        return None
    assert back.faults == ()
    assert back.head == chains[len(back.holes) + (back.stop is not None)]
    return len(back.holes)


def check_cuts(recorded, count):
    _, lengths, _ = recorded
    size = recorded[0].stat().st_size
    for length in np.random.default_rng(3).integers(0, size, count):
        whole = sum(length >= end for end in lengths)
        assert cut(recorded, int(length)) == (None if whole == 0 else whole - 1), length


class GuardedReader:
    """Reads in another process, and begins a new one when the content took it down."""

    def __init__(self):
        self.stack, self.downs = ExitStack(), 0
        self.executor = self.stack.enter_context(processes(1))

    def __call__(self, path):
        try:
            return self.executor.submit(read, path).result(timeout=60)
        except DocumentError:
            return None
        except BrokenProcessPool:
            self.stack.close()
            self.executor, self.downs = self.stack.enter_context(processes(1)), self.downs + 1
            return None


@pytest.fixture
def reader():
    guarded_reader = GuardedReader()
    with guarded_reader.stack:
        yield guarded_reader


def check_changes(recorded, count, reader):
    """Change single bytes: the seal always tells; what is read all the same is right or faulty."""
    path, _, chains = recorded
    content, rng = path.read_bytes(), np.random.default_rng(4)
    path.chmod(0o644)
    for place in rng.integers(0, len(content), count):
        changed = bytearray(content)
        changed[place] ^= rng.integers(1, 256)
        path.write_bytes(changed)
        _, checks = check_seal(path)
        assert checks[0].passed is False
        back = reader(path)
        if back is not None:
            untouched = not back.faults and not back.missing and not back.losses
            assert not untouched or back.head in chains, place


def test_cut_at_random_it_is_read_to_the_last_whole_hole(recorded):
    check_cuts(recorded, 25)


def test_cut_at_the_border_of_each_hole(recorded):
    for holes, length in enumerate(recorded[1]):
        assert cut(recorded, length) == holes
        assert cut(recorded, length - 1) == (holes - 1 if holes else None)


def test_a_changed_byte_is_found_out(recorded, reader):
    check_changes(recorded, 40, reader)


def test_content_that_takes_the_reader_down_is_one_sentence(recorded):
    with pytest.raises(DocumentError, match="is damaged"):
        guarded(abort, recorded[0])


@pytest.mark.soak
def test_two_hundred_cuts(recorded):
    check_cuts(recorded, 200)


@pytest.mark.soak
def test_five_hundred_changed_bytes(recorded, reader):
    check_changes(recorded, 500, reader)


def test_a_repaired_copy_is_sealed_as_such_and_names_the_untouched_original(recorded):
    path, lengths, chains = recorded
    torn = path.with_name("torn.rrd")
    torn.write_bytes(path.read_bytes()[:lengths[3] + 1000])
    before = torn.read_bytes()
    seal = repair(torn)
    copy = torn.with_name("torn.repaired.rrd")
    assert (seal.status, seal.holes, seal.chain) == ("repaired", 3, chains[3])
    assert seal.original.file == "torn.rrd"
    assert torn.read_bytes() == before
    assert before.startswith(copy.read_bytes())
    assert len(read(copy).holes) == 3
    assert all(check.passed is not False for check in check_seal(copy)[1])


def test_what_is_sealed_altered_or_repaired_before_is_not_repaired(recorded):
    path, _, _ = recorded
    with pytest.raises(DocumentError, match="nothing to repair"):
        repair(path)
    seal_path(path).unlink()
    repair(path)
    with pytest.raises(DocumentError, match="repaired before"):
        repair(path)


def test_an_empty_file_and_a_folder_are_refused(tmp_path):
    empty = tmp_path / "empty.rrd"
    empty.touch()
    for path in (empty, tmp_path, tmp_path / "absent.rrd"):
        with pytest.raises(DocumentError):
            read(path)
