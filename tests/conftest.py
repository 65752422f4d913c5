"""What several rooms' tests share: the test data that is not ours, and one run of the demo job."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import hypothesis
import pytest

# The same examples every time, and no judgement of the machine: a red run means a fault.
hypothesis.settings.register_profile("house", deadline=None, derandomize=True,
                                     suppress_health_check=[
                                         hypothesis.HealthCheck.too_slow,
                                         hypothesis.HealthCheck.filter_too_much])
hypothesis.settings.load_profile("house")

ROOT = Path(__file__).parents[1]


def test_data(name: str) -> Path:
    """Find a folder of the test data, or skip with the reason."""
    folder = Path(os.environ.get("CELL_TEST_DATA", ROOT.parent / "shared" / "data")) / name
    if not folder.is_dir():
        pytest.skip(f"no test data at {folder}: set CELL_TEST_DATA")
    return folder


@pytest.fixture(scope="session", name="test_data")
def _test_data() -> Path:
    """The folder of the test data, for tests that use several of its parts."""
    return test_data("")


@dataclass(frozen=True)
class DemoRun:
    """One run of jobs/demo.yaml on the virtual cell, ten times faster than real time."""

    folder: Path
    exit_code: int
    answer: dict
    truth: dict

    @property
    def log(self) -> Path:
        return self.folder / self.answer["log"]


@pytest.fixture(scope="session")
def cell_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working folder with copies of jobs/ and calibration/, as a fresh clone has them."""
    folder = tmp_path_factory.mktemp("plant")
    for name in ("jobs", "calibration"):
        shutil.copytree(ROOT / name, folder / name)
    return folder


def run_cell(*words: str, folder: Path, timeout: float = 170.0) -> subprocess.CompletedProcess[str]:
    """Run the command `cell` as a user would."""
    return subprocess.run([sys.executable, "-m", "cell", *words], cwd=folder, text=True,
                          capture_output=True, timeout=timeout, check=False)


@pytest.fixture(scope="session")
def demo_run(cell_folder: Path) -> DemoRun:
    done = run_cell("run", "jobs/demo.yaml", "--speed", "10", "--truth", "truth.json", "--json",
                    folder=cell_folder)
    assert done.returncode in (0, 1), done.stderr
    return DemoRun(cell_folder, done.returncode, json.loads(done.stdout),
                   json.loads((cell_folder / "truth.json").read_text()))
