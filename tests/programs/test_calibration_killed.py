"""kill -9 between any two views of a calibration: `--resume` goes on, and the set is made."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cell.archive.sets import active_set, check_set
from cell.programs.calibration.session import Session

ROOT = Path(__file__).parents[2]
QUICK = "views: 8\nhold_out: 0\nsphere_views: 6\nreason: a trial\n"
WHOLE = "views: 14\nearly_stop: false\nhold_out: 3\nsphere_views: 6\nreason: a trial\n"
PATIENCE = 120.0  # s
pytestmark = pytest.mark.timeout(400)


@pytest.fixture
def plant(tmp_path):
    shutil.copytree(ROOT / "calibration", tmp_path / "calibration")
    return tmp_path


def start(plant, what, *words):
    return subprocess.Popen(
        [sys.executable, "-m", "cell", "calibrate", what, "--cell", "demo", "--plan", "plan.yaml",
         "--yes", "--speed", "20", "--json", *words],
        cwd=plant, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def kill_after(plant, lines, process):
    """Kill without warning as soon as so many views are on the disk; return their lines."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        written = [line for file in plant.glob("calibration/demo/sessions/*/views.jsonl")
                   for line in file.read_text().splitlines()]
        if len(written) >= lines:
            process.kill()
            process.communicate()
            return written
        time.sleep(0.02)
    process.kill()
    pytest.fail(f"no {lines} views in time: {process.communicate()[1][-2000:]}")


def check_resumed(plant, what, plan, lines):
    (plant / "plan.yaml").write_text(plan)
    before = kill_after(plant, lines, start(plant, what))
    home = plant / "calibration" / "demo"
    assert active_set(home) == "2026-11-20a"
    out, err = start(plant, what, "--resume").communicate(timeout=300)
    answer = json.loads(out)
    assert answer["set"] and active_set(home) == answer["set"], err[-2000:]
    sessions = list((home / "sessions").iterdir())
    assert len(sessions) == 1
    kept = (sessions[0] / "views.jsonl").read_text().splitlines()
    assert kept[:len(before)] == before
    session = Session.read(sessions[0])
    planned = len(session.header.targets)
    assert [view.number for view in session.views] == list(range(1, planned + 1))
    assert len(kept) == planned  # none was taken twice
    check_set(home / "sets" / answer["set"])


def test_a_killed_session_goes_on(plant):
    check_resumed(plant, "light-plane", QUICK, 4)


@pytest.mark.soak
@pytest.mark.parametrize("lines", [1, 2, 9, 14, 16, 19, 22])
def test_a_killed_session_goes_on_wherever_it_was(plant, lines):
    check_resumed(plant, "all", WHOLE, lines)
