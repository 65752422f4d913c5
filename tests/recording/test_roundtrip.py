"""What is read is what was written, to the last bit."""

import pickle
import resource
import subprocess
import sys
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from cell.core.errors import DocumentError, RecordingError
from cell.recording.reader import read
from cell.recording.writer import Recorder


def same(one, other) -> bool:
    """Compare bit for bit, through records, tuples and dictionaries (order included)."""
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(same(getattr(one, field.name), getattr(other, field.name))
                   for field in fields(one))
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and one.dtype == other.dtype \
            and one.tobytes() == other.tobytes()
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    return repr(one) == repr(other)  # -0.0 and NaN included


def record(path, start, holes, stop):
    recorder = Recorder(path, start)
    for hole in holes:
        recorder.write_hole(hole)
    recorder.finish(stop)


def test_a_recording_gives_back_exactly_what_was_written(tmp_path, papers):
    holes = [papers.hole(0), papers.hole(1, views=6), papers.hole(2)]
    start, stop = papers.start(), papers.stop(3)
    record(tmp_path / "a.rrd", start, holes, stop)
    back = read(tmp_path / "a.rrd")
    assert same(back.start, start)
    assert same(back.holes, holes)
    assert same(back.stop, stop)
    assert (back.status, back.faults, back.losses, back.missing) == ("complete", (), (), 0)


def test_a_body_without_holes_and_with_equal_images(tmp_path, papers):
    hole = papers.hole(0, views=4)
    views = tuple(type(view)(**{**view.__dict__, "image": np.zeros((48, 64), np.uint8)})
                  for view in hole.observation.views)
    dark = type(hole)(0, type(hole.observation)("H0", views, hole.observation.body_from_predicted),
                      hole.attempts)
    record(tmp_path / "a.rrd", papers.start(), [], papers.stop(0))
    record(tmp_path / "b.rrd", papers.start(), [dark], papers.stop(1))
    assert read(tmp_path / "a.rrd").holes == []
    assert same(read(tmp_path / "b.rrd").holes, [dark])


def test_an_existing_file_is_refused_and_left_alone(tmp_path, papers):
    path = tmp_path / "a.rrd"
    path.write_bytes(b"precious")
    with pytest.raises(DocumentError, match="never overwritten"):
        Recorder(path, papers.start())
    assert path.read_bytes() == b"precious"


def test_a_folder_that_is_not_there_is_refused(tmp_path, papers):
    with pytest.raises(DocumentError, match="cannot be written"):
        Recorder(tmp_path / "nowhere" / "a.rrd", papers.start())


def test_a_killed_run_keeps_every_hole_that_was_flushed(tmp_path, papers):
    killed = subprocess.Popen([sys.executable, "-c", KILLED, tmp_path / "a.rrd"],
                              stdin=subprocess.PIPE)
    killed.communicate(pickle.dumps((papers.start(), [papers.hole(k) for k in range(3)])))
    back = read(tmp_path / "a.rrd")
    assert killed.returncode == -9
    assert (back.status, len(back.holes), back.faults) == ("died", 3, ())


KILLED = """
import os, pickle, sys
from pathlib import Path
from cell.recording.writer import Recorder
start, holes = pickle.load(sys.stdin.buffer)
recorder = Recorder(Path(sys.argv[1]), start)
for hole in holes:
    recorder.write_hole(hole)
recorder.wait()
os.kill(os.getpid(), 9)
"""


def test_a_disk_that_fills_up_is_told_at_the_next_call(tmp_path, papers):
    path = tmp_path / "a.rrd"
    recorder = Recorder(path, papers.start())
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 40_000, hard))
    try:
        with pytest.raises(RecordingError, match=r"a\.rrd: cannot be written"):
            for index in range(1000):
                recorder.write_hole(papers.hole(index))
        with pytest.raises(RecordingError):
            recorder.finish(papers.stop(1000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    kept = read(path)
    assert kept.status == "died"
    assert 1 <= len(kept.holes) < 20
