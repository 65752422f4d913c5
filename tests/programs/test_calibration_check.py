"""The check between calibrations, on the virtual cell."""

import json
import shutil
from pathlib import Path

import pytest
from made_operator import Scripted

from cell.core.errors import DocumentError
from cell.programs.calibration.check import CheckRequest, check_cell

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.timeout(300)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = tmp_path_factory.mktemp("check") / "calibration"
    shutil.copytree(ROOT / "calibration", folder)
    return folder


@pytest.fixture(scope="module")
def twice(plant):
    request = CheckRequest("demo", plant, speed=20.0)
    return check_cell(request, Scripted()), check_cell(request, Scripted())


def test_the_first_check_is_the_reference_and_the_next_is_held_against_it(plant, twice):
    first, second = twice
    assert first.drift is None and second.drift.alarm == "ok"
    assert set(second.drift.shifts) == {"table corner 0", "table corner 1", "table corner 2",
                                        "table corner 3", "check centre"}
    lines = [json.loads(line) for line
             in (plant / "demo" / "drift" / "log.jsonl").read_text().splitlines()]
    assert [line["alarm"] for line in lines] == ["reference", "ok"]
    assert all(len(line["joint_temperatures_c"]) == 6 for line in lines)


def test_the_sphere_is_measured_through_the_laser(twice):
    gates = {gate.name: gate for gate in twice[0].gates}
    assert gates["poses"].value == 8
    assert gates["spread_mm"].value < 0.4 and not twice[0].refused
    again = twice[1].drift.shifts["check centre"]
    assert abs(again).max() < 0.05  # mm: it repeats better than it is true


def test_nothing_moves_without_consent(plant):
    with pytest.raises(DocumentError, match="stopped by the operator"):
        check_cell(CheckRequest("demo", plant, speed=20.0), Scripted({"Is the way clear": False}))
