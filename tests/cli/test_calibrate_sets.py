"""`cell calibrate history|diff|activate|rollback` on a copy of the demo cell."""

import json
import shutil

import pytest
import yaml

FIRST = "2026-11-20a"


@pytest.fixture
def second(workplace):
    """A set beside the first, its camera 0.2 mm further along the flange's x."""
    from pathlib import Path
    sets = Path("calibration") / "demo" / "sets"
    shutil.copytree(sets / FIRST, sets / "2026-11-21b")
    file = sets / "2026-11-21b" / "hand_eye.yaml"
    document = yaml.safe_load(file.read_text())
    document["flange_from_camera"][0][3] += 0.2
    file.write_text(yaml.safe_dump(document))
    return "2026-11-21b"


def test_activate_history_and_rollback(cell, second):
    code, out, _ = cell("calibrate", "activate", second, "--by", "ann", "--reason", "new lens")
    assert code == 0 and second in out
    assert cell("calibrate", "rollback", "--by", "bob")[0] == 0
    _, out, _ = cell("calibrate", "history", "--json")
    past = json.loads(out)["history"]
    assert [row["set"] for row in past] == [FIRST, second, FIRST]
    assert (past[1]["by"], past[1]["reason"], past[2]["by"]) == ("ann", "new lens", "bob")


def test_diff_speaks_of_a_measured_point(cell, second):
    code, out, _ = cell("calibrate", "diff", FIRST, second, "--json")
    changes = json.loads(out)["changes"]
    assert code == 0
    assert changes["point_mm"] == pytest.approx(0.2, abs=1e-6)
    assert changes["mount_mm"] == pytest.approx(0.2, abs=1e-6)
    assert changes["focal_percent"] == changes["plane_deg"] == 0.0
    assert "0.2000" in cell("calibrate", "diff", FIRST, second)[1]


@pytest.mark.parametrize(("blurs", "change"), [((1.0, 1.1), 10.0), ((1.0, 0.9), -10.0),
                                               ((None, 1.1), None), ((1.0, None), None)])
def test_diff_compares_the_softness_of_edges_where_both_sets_know_it(cell, second, blurs, change):
    from pathlib import Path
    for name, blur in zip((FIRST, second), blurs, strict=True):
        file = Path("calibration") / "demo" / "sets" / name / "sensor.yaml"
        document = yaml.safe_load(file.read_text()) | {"blur": blur}
        file.write_text(yaml.safe_dump(document))
    _, out, _ = cell("calibrate", "diff", FIRST, second, "--json")
    assert json.loads(out)["changes"].get("blur_percent") == (change and pytest.approx(change))
    shown = "softness of a sharp edge" in cell("calibrate", "diff", FIRST, second)[1]
    assert shown == (change is not None)


def test_a_set_of_another_robot_is_not_gone_back_to(cell, second):
    from pathlib import Path
    file = Path("calibration") / "demo" / "sets" / second / "hand_eye.yaml"
    document = yaml.safe_load(file.read_text())
    document["robot"]["serial"] = "20260000001"
    file.write_text(yaml.safe_dump(document))
    code, _, err = cell("calibrate", "rollback", second)
    assert code == 2 and "another robot" in err.replace("\n", " ")


@pytest.mark.parametrize("words", [("activate", "2026-01-01x"), ("rollback",),
                                   ("diff", FIRST, "none"), ("history", "--cell", "nope")])
def test_what_is_not_there_ends_with_2(cell, workplace, words):
    assert cell("calibrate", *words)[0] == 2


def test_a_plan_that_is_wrong_is_refused_before_anything_opens(cell, workplace, tmp_path):
    plan = tmp_path / "plan.yaml"
    plan.write_text("views: 3\n")
    code, _, err = cell("calibrate", "all", "--plan", plan, "--yes")
    assert code == 2 and "views" in err
