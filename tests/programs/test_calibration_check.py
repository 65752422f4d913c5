"""The check between calibrations, on the virtual cell."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from made_operator import Scripted

from cell.archive.files import read_text
from cell.core.documents.calibration import BodyDocument
from cell.core.documents.text import parse
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
    assert all(20.0 < line["camera_temperature_c"] < 40.0 for line in lines)


def test_the_sphere_is_measured_through_the_laser(twice):
    gates = {gate.name: gate for gate in twice[0].gates}
    assert gates["poses"].value == 8
    assert gates["spread_mm"].value < 0.4 and not twice[0].refused
    again = twice[1].drift.shifts["check centre"]
    assert abs(again).max() < 0.05  # mm: it repeats better than it is true


def test_nothing_moves_without_consent(plant):
    with pytest.raises(DocumentError, match="stopped by the operator"):
        check_cell(CheckRequest("demo", plant, speed=20.0), Scripted({"Is the way clear": False}))


def registration(plant):
    file = plant / "demo" / "body" / "demo.yaml"
    return parse(BodyDocument, read_text(file), str(file))


def shift_reference(plant, shift):
    """As if all artefacts had stood elsewhere when the set was made."""
    file = plant / "demo" / "drift" / "log.jsonl"
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    lines[0]["places"] = {name: (np.array(place) - shift).tolist()
                          for name, place in lines[0]["places"].items()}
    file.write_text("".join(json.dumps(line) + "\n" for line in lines[:1]))


def test_drift_is_taken_back_on_request_only_and_the_registration_kept(plant, twice):
    shift, before = np.array([0.09, -0.05, 0.07]), registration(plant)
    assert before.drift_correction is None
    shift_reference(plant, shift)
    operator = Scripted()
    done = check_cell(CheckRequest("demo", plant, speed=20.0, correct=True), operator)
    after = registration(plant)
    assert done.drift.alarm == "act" and done.corrected
    assert operator.heard("Correct the registrations of demo by 0.1")
    assert after.base_from_body == before.base_from_body
    assert np.array(after.drift_correction)[:3, 3] == pytest.approx(shift, abs=0.03)
    last = json.loads((plant / "demo" / "drift" / "log.jsonl").read_text().splitlines()[-1])
    assert last["alarm"] == "corrected" and len(last["joint_temperatures_c"]) == 6
    assert len(list((plant / "demo" / "body" / "history").iterdir())) == 1
