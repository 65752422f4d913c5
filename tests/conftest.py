"""Fixtures that several rooms share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def test_data() -> Path:
    """The folder of reference data: CELL_TEST_DATA, or ../shared/data beside the repository."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("CELL_TEST_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no reference data in {folder}: set CELL_TEST_DATA")
    return folder
