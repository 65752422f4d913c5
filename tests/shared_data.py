"""Where the test data lies that is not ours: CELL_TEST_DATA, or beside the repository."""

import os
from pathlib import Path

import pytest


def shared_data(name: str) -> Path:
    """Find a folder of the test data, or skip with the reason."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("CELL_TEST_DATA", beside)) / name
    if not folder.is_dir():
        pytest.skip(f"no test data at {folder}: set CELL_TEST_DATA")
    return folder
