import json
from pathlib import Path

import pytest


def test_table_2_is_tabulated_by_point_and_axis(cell, workplace):
    code, out, _ = cell("compare", "jobs/paper/table2_measured.csv",
                        "jobs/paper/table2_nominals.csv")
    assert code == 0
    assert "+0.1315" in out
    assert "-0.0422" in out
    assert "y: the bias of -0.0422 mm is significant" in out


def test_json_has_null_where_an_axis_does_not_count(cell, workplace):
    _, out, _ = cell("compare", "jobs/paper/table2_measured.csv", "jobs/paper/table2_nominals.csv",
                     "--json")
    answer = json.loads(out)
    assert answer["points"][7] == {"id": "P8", "deviation_mm": {
        "x": None, "y": None, "z": pytest.approx(-0.0441)}}
    assert answer["axes"]["z"]["n"] == 7
    assert answer["axes"]["z"]["max_mm"] == pytest.approx(0.1315)


def test_repeated_measurements_show_their_spread(cell, workplace):
    code, out, _ = cell("compare", "jobs/paper/table1_measured.csv",
                        "jobs/paper/table1_nominals.csv")
    assert code == 0
    assert "P1 repeated 5 times: standard deviation x 0.0143, y 0.0027, z 0.0082 mm" in out


@pytest.mark.parametrize(("words", "said"), [
    (("jobs/paper/none.csv", "jobs/paper/table2_nominals.csv"), "none.csv: there is no such file"),
    (("jobs/paper/table2_measured.csv", "jobs/paper/table1_nominals.csv"),
     "table2_measured.csv: measured but not among the nominals"),
    (("jobs/demo.yaml", "jobs/demo.csv"), "demo.yaml: line 1"),
])
def test_what_cannot_be_compared_ends_with_2(cell, workplace, words, said):
    code, _, err = cell("compare", *words)
    assert code == 2
    assert said in " ".join(err.split())


def test_a_diameter_under_the_other_tables_name_is_told(cell, workplace):
    for name, column in (("measured", "diameter"), ("nominals", "d")):
        Path(f"{name}.csv").write_text(f"id,x,y,z,{column}\nA,1,2,3,8\n")
    Path("plain.csv").write_text("id,x,y,z\nA,1,2,3\n")
    assert "did you mean 'd'?" in cell("compare", "measured.csv", "plain.csv")[2]
    assert "did you mean 'diameter'?" in cell("compare", "plain.csv", "nominals.csv")[2]
