from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cell.core.documents.points import Point, read_measured_points, read_nominal_points
from cell.core.errors import DocumentError
from cell.metrology.judge.compare import compare_points

PAPER = Path(__file__).parents[3] / "jobs" / "paper"


def compare_table(number):
    measured = read_measured_points((PAPER / f"table{number}_measured.csv").read_text(), "measured")
    nominals = read_nominal_points((PAPER / f"table{number}_nominals.csv").read_text(), "nominals")
    return compare_points(measured, nominals)


def test_table_1_of_the_paper_repeats_as_printed():
    comparison = compare_table(1)
    n, spread = comparison.repeatability["P1"]
    assert n == 5
    assert {axis: round(sd, 4) for axis, sd in spread.items()} == \
        {"x": 0.0143, "y": 0.0027, "z": 0.0082}
    assert {axis: round(found.sd, 4) for axis, found in comparison.axes.items()} == \
        {"x": 0.0143, "y": 0.0027, "z": 0.0082}


def test_table_2_of_the_paper_deviates_as_printed():
    axes = compare_table(2).axes
    assert {axis: found.n for axis, found in axes.items()} == {"x": 6, "y": 5, "z": 7}
    assert [axes[axis].mean for axis in "xyz"] == pytest.approx([-0.00205, -0.04224, 0.04867],
                                                               abs=5e-6)
    assert [axes[axis].sd for axis in "xyz"] == pytest.approx([0.0319, 0.0077, 0.0557], abs=5e-5)
    assert [axes[axis].rms for axis in "xyz"] == pytest.approx([0.029, 0.043, 0.071], abs=5e-4)
    assert (round(axes["z"].max, 4), axes["z"].max_id) == (0.1315, "P4")


def test_the_paper_s_printed_differences_are_found(test_tables):
    comparison = compare_table(2)
    for row, point in zip(test_tables, comparison.points, strict=True):
        for axis in "xyz":
            printed = row[f"d{axis}_mm"]
            assert (axis in point.values) == bool(printed)
            if printed:
                assert point.values[axis] == pytest.approx(float(printed), abs=1e-9)


def test_only_the_bias_in_y_of_table_2_is_more_than_chance():
    axes = compare_table(2).axes
    assert axes["y"].t == pytest.approx(-12.2, abs=0.05)
    assert [axis for axis, found in axes.items() if found.p < 0.05] == ["y"]


@pytest.fixture
def test_tables():
    import csv
    import os

    folder = Path(os.environ.get("CELL_TEST_DATA", PAPER.parents[2] / "shared" / "data"))
    table = folder / "paper" / "table2.csv"
    if not table.exists():
        pytest.skip(f"no test data at {folder}: set CELL_TEST_DATA")
    with table.open() as file:
        return list(csv.DictReader(file))


def test_an_empty_cell_is_not_controlled_and_no_zero():
    measured = read_measured_points("id,x,y,z\nA,1.5,,300\n", "m")
    nominals = read_nominal_points("id,x,y,z\nA,1,200,\n", "n")
    assert compare_points(measured, nominals).points[0].values == {"x": pytest.approx(0.5)}


def test_control_says_what_counts():
    measured = read_measured_points("id,x,y,z,d\nA,101,202,303,5.1\n", "m")
    nominals = read_nominal_points("id,x,y,z,diameter,control\nA,100,200,300,5,yd\n", "n")
    assert compare_points(measured, nominals).points[0].values == \
        {"y": pytest.approx(2.0), "d": pytest.approx(0.1)}


def test_a_whole_nominals_table_will_do(workplace):
    nominals = read_nominal_points(workplace.nominals.read_text(), "demo.csv")
    assert len(nominals) == 24
    assert set(next(point for point in nominals if point.id == "BP4").values) == set("xzd")


def test_nominals_that_were_not_measured_are_named():
    measured = read_measured_points("id,x,y,z\nA,100,200,300\n", "m")
    nominals = read_nominal_points("id,x,y,z\nA,100,200,300\nB,1,2,3\n", "n")
    comparison = compare_points(measured, nominals)
    assert comparison.missing == ("B",)
    assert comparison.axes["x"].sd is None
    assert comparison.axes["x"].t is None


@pytest.mark.parametrize(("measured", "nominals", "words"), [
    ("id,x,y\nA,1,2\n", "id,x,y,z\nA,1,2,3\n", "m: line 1: missing: z"),
    ("id;x;y;z\nA;1;2;3\n", "id,x,y,z\nA,1,2,3\n", "semicolons"),
    ("id,x,y,z\nA,1,2,z\n", "id,x,y,z\nA,1,2,3\n", "column z: expected a finite number"),
    ("id,x,y,z\nA,1,2,3\n", "id,x,y,z\nB,1,2,3\n", "not among the nominals: A"),
    ("id,x,y,z\nA,1,2,3\n", "id,x,y,z\nA,1,2,3\nA,1,2,3\n", "n: line 3.*stands twice"),
    ("id,x,y,z\nA,,,3\n", "id,x,y,z\nA,1,2,\n", "no point has an axis"),
    ("id,x,y,z\n", "id,x,y,z\nA,1,2,3\n", "no point"),
    ("id,x,y,z\nA,1,2,3\nB,3,2,3\nC,1,1,1\n", "id,x,y,z\nA,1,2,3\n", "m: .*metres"),
    ("id,x,y,z\nA,1.4,0.7,0.3\n", "id,x,y,z\nA,1400,700,300\n", "measured values.*metres"),
    ("id,x,y,z\nA,1,2,3\n", "id,x,y,z,control\nA,1,2,3,w\n", "column control"),
])
def test_wrong_tables_are_refused(measured, nominals, words):
    with pytest.raises(DocumentError, match=words):
        compare_points(read_measured_points(measured, "m"), read_nominal_points(nominals, "n"))


@given(st.lists(st.floats(-2, 2), min_size=2, max_size=20), st.floats(-1000, 1000))
def test_bias_and_spread_are_those_of_the_deviations(gaps, nominal):
    points = [Point(f"P{i}", {"x": nominal + 2000 + gap}) for i, gap in enumerate(gaps)]
    nominals = [Point(f"P{i}", {"x": nominal + 2000}) for i in range(len(gaps))]
    found = compare_points(points, nominals).axes["x"]
    assert found.mean == pytest.approx(np.mean(gaps), abs=1e-9)
    assert found.sd == pytest.approx(np.std(gaps, ddof=1), abs=1e-9)
    assert found.max == pytest.approx(np.abs(gaps).max(), abs=1e-9)
    assert found.rms**2 == pytest.approx(found.mean**2 + found.sd**2 * (len(gaps) - 1) / len(gaps),
                                         abs=1e-9)
