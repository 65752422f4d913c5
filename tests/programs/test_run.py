"""`cell run` from outside: the contract of its answer, and honest numbers."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

AXES = "xyzd"


def holes_of(answer: dict) -> dict[str, dict]:
    return {feature["id"]: feature for feature in answer["features"]}


def test_every_hole_of_the_demo_is_measured_and_the_bad_ones_are_found(demo_run) -> None:
    features = holes_of(demo_run.answer)
    assert len(features) == 24
    assert demo_run.exit_code == 1
    assert demo_run.answer["verdict"] == "out_of_tolerance"
    out = {name for name, feature in features.items() if feature["verdict"] != "in_tolerance"}
    assert 1 <= len(out) <= 2
    assert all(features[name]["verdict"] == "out_of_tolerance" for name in out)


def test_the_error_against_the_truth_is_what_the_stated_uncertainty_says(demo_run) -> None:
    truth = {hole["id"]: hole for hole in demo_run.truth["holes"]}
    scaled = np.array([
        [(feature["measured_mm"][axis] - true) / feature["uncertainty_mm"][axis]
         for axis, true in zip("xyz", truth[name]["centre_mm"], strict=True)]
        for name, feature in holes_of(demo_run.answer).items()])
    assert np.abs(scaled).max() < 4.0
    assert np.sqrt(np.mean(scaled**2)) < 2.0
    assert demo_run.truth["body"] == demo_run.answer["body"]


def test_a_displaced_body_shows_in_every_deviation(demo_run) -> None:
    """Without an alignment the frame is the fixture's: the deviations follow the true ones."""
    truth = {hole["id"]: hole["centre_mm"] for hole in demo_run.truth["holes"]}
    for name, feature in holes_of(demo_run.answer).items():
        for axis, true in zip("xyz", truth[name], strict=True):
            nominal = feature["nominal_mm"][axis]
            if nominal is not None:
                assert feature["deviation_mm"][axis] == pytest.approx(true - nominal, abs=0.7)


def test_uncontrolled_axes_are_null_and_controlled_ones_are_numbers(demo_run) -> None:
    features = holes_of(demo_run.answer)
    controlled = [{axis for axis in AXES if feature["nominal_mm"][axis] is not None}
                  for feature in features.values()]
    assert any(len(axes) < 4 for axes in controlled)
    for feature, axes in zip(features.values(), controlled, strict=True):
        assert {axis for axis in AXES if feature["deviation_mm"][axis] is not None} == axes
        assert all(feature["measured_mm"][axis] is not None for axis in AXES)
        assert all(feature["uncertainty_mm"][axis] > 0.0 for axis in AXES)


def test_it_leaves_a_recording_a_seal_and_a_report_with_no_body_in_their_names(demo_run) -> None:
    log = demo_run.log
    assert log.is_file()
    assert (demo_run.folder / demo_run.answer["report"]).is_file()
    assert log.with_name(log.name + ".seal.json").is_file()
    assert demo_run.answer["body"] not in log.name
    page = (demo_run.folder / demo_run.answer["report"]).read_text()
    assert not re.search(r"""(src|href|url\()\s*=?\s*["']?https?:""", page)


@pytest.fixture
def running(cell_folder: Path, tmp_path: Path):
    """A run in real time, a few holes in."""
    process = subprocess.Popen(
        [sys.executable, "-m", "cell", "run", "jobs/demo.yaml", "--speed", "3", "--logs",
         str(tmp_path), "--json"], cwd=cell_folder, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, start_new_session=True)
    yield process, tmp_path
    process.kill()
    process.communicate()


def wait_for_holes(folder: Path, size: int) -> None:
    deadline = time.monotonic() + 90.0
    while time.monotonic() < deadline:
        logs = list(folder.glob("*.rrd"))
        if logs and logs[0].stat().st_size > size:
            return
        time.sleep(0.1)
    pytest.fail("no hole was recorded")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_stops_the_robot_and_closes_its_recording(running, number) -> None:
    from cell.recording import read

    process, folder = running
    wait_for_holes(folder, 1_200_000)
    os.kill(process.pid, number)
    out, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    (log,) = folder.glob("*.rrd")
    recording = read(log)
    assert recording.status == "interrupted"
    assert 1 <= len(recording.holes) < 24
    assert not recording.faults
    assert json.loads(out)["features"]


def test_a_killed_run_leaves_every_finished_hole(running) -> None:
    from cell.recording import read

    process, folder = running
    wait_for_holes(folder, 1_200_000)
    process.kill()
    process.communicate()
    (log,) = folder.glob("*.rrd")
    recording = read(log)
    assert recording.status == "died"
    assert len(recording.holes) >= 1
