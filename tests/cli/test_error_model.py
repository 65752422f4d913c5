"""`cell error-model`: the table, the picture, and ranges that make no sense."""

import json

import cv2
import pytest

SENSOR = "calibration/demo/sets/2026-11-20a/sensor.yaml"


def test_the_printed_plane_and_the_papers_box(cell, workplace):
    code, out, _ = cell("error-model", "--sensor", SENSOR, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["L_mm"] == pytest.approx(242.43, abs=0.01)
    assert answer["alpha_deg"] == pytest.approx(29.03, abs=0.01)
    assert answer["paper_mm"]["z"] == pytest.approx(0.277, abs=1e-3)
    assert answer["paper_mm"]["x"] == pytest.approx(0.0058, abs=1e-4)
    assert [row["hole_radius"] for row in answer["general_mm"]] == [3.0, 5.0, 10.0, 15.0]


def test_errors_grow_with_the_tilt(cell, workplace):
    def error(*more):
        return json.loads(cell("error-model", "--sensor", SENSOR, "--json", *more)[1])

    small, large = error(), error("--tilt-deg", "10", "--radius", "10")
    assert large["paper_mm"]["z"] > 4.0 * small["paper_mm"]["z"]
    assert large["general_mm"][0]["x"] > 0.05


def test_the_figures_are_drawn(cell, workplace):
    code, out, _ = cell("error-model", "--sensor", SENSOR, "--picture", "errors.png")
    assert code == 0
    assert "(17), (20), (15)" in out
    assert cv2.imread(str(workplace.folder / "errors.png")).shape[1] > 800


@pytest.mark.parametrize("more", [("--tilt-deg", "0"), ("--tilt-deg", "80"), ("--x-mm", "-1"),
                                  ("--radius", "nan"), ("--picture", "nowhere/errors.png")])
def test_ranges_that_make_no_sense_are_bad_input(cell, workplace, more):
    assert cell("error-model", "--sensor", SENSOR, *more)[0] == 2
