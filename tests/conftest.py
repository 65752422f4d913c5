"""Fixtures that several rooms share."""

import os
from pathlib import Path

import pytest
from made_workplace import Workplace


@pytest.fixture(scope="session")
def test_data() -> Path:
    """The folder of reference data: CELL_TEST_DATA, or ../shared/data beside the repository."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("CELL_TEST_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no reference data in {folder}: set CELL_TEST_DATA")
    return folder


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workplace:
    """A working folder with a copy of the demo's documents; the test runs in it."""
    monkeypatch.chdir(tmp_path)
    return Workplace.in_folder(tmp_path)
