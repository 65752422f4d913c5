import json

import pytest


def test_the_demo_job_can_run(cell, workplace):
    code, out, err = cell("check", workplace.job)
    assert code == 0, err
    assert "The job can run: 24 stops" in out
    assert "BP5" in out


def test_json_is_one_object_and_the_rest_is_on_standard_error(cell, workplace):
    code, out, _ = cell("check", workplace.job, "--json")
    answer = json.loads(out)
    assert (code, answer["ok"], answer["set"]) == (0, True, workplace.active_set.name)
    assert len(answer["stops"]) == answer["holes"] == 24
    stop = answer["stops"][0]
    assert stop["clearance_mm"] > 25.0
    assert len(stop["joints_deg"]) == 6
    assert answer["refusals"] == []
    assert 20.0 < answer["station_time_s"] < 90.0


def test_the_schema_of_a_job_is_printed_for_editors(cell, workplace):
    code, out, _ = cell("check", "--schema")
    schema = json.loads(out)
    assert code == 0
    assert {"name", "cell", "nominals", "stops", "alignment"} <= set(schema["properties"])
    assert schema["additionalProperties"] is False


def test_no_job_is_a_question(cell):
    code, _, err = cell("check")
    assert code == 2
    assert "which job?" in err


def test_a_plan_that_cannot_be_driven_is_refused_with_every_reason(cell, workplace):
    workplace.replace(workplace.cell / "cell.yaml", "[95.0, 225.0]", "[95.0, 150.0]")
    code, out, err = cell("check", workplace.job)
    assert code == 2
    assert "stop BP5: joint 1 at" in err
    assert "allowed are 95 to 150" in err
    assert "can run" not in out
    code, out, _ = cell("check", workplace.job, "--json")
    answer = json.loads(out)
    assert (code, answer["ok"]) == (2, False)
    assert any(refusal["stop"] == "BP5" for refusal in answer["refusals"])


DOCUMENTS = ("active", "body", "cell", "hand_eye", "job", "nominals", "sensor")


@pytest.mark.parametrize(("document", "old", "new", "words"), [
    ("job", "body_type:", "bodytype:", ["line 5", "'bodytype' is unknown", "'body_type'"]),
    ("job", "cell: demo", "cell: demo\ncell: demo", ["line 4", "'cell' stands twice"]),
    ("job", "cell: demo", "cell: other", ["no cell 'other'", "known: demo"]),
    ("job", "nominals: demo.csv", "nominals: none.csv", ["jobs/none.csv", "no such file"]),
    ("job", "nominals: demo.csv", "nominals: ../demo.csv", ["nominals", "leaves"]),
    ("job", "nominals: demo.csv", "nominals: /etc/hostname", ["nominals", "leaves"]),
    ("job", "{hole: SI3}", "{hole: SI9}", ["stops[5].hole", "'SI9'"]),
    ("job", "{hole: SI3}", "{hole: SI4}", ["stops[6].hole", "two stops"]),
    ("job", "{hole: SI3}", "!!python/object:os.system {hole: SI3}", ["tag", "line 12"]),
    ("job", "{hole: SI3}", "&a {hole: *a}", ["anchors"]),
    ("nominals", "tol_d", "tolerance_d", ["demo.csv: line 1", "'tolerance_d' is unknown"]),
    ("nominals", "BP2,", "BP1,", ["line 3 (BP1), column id", "stands twice"]),
    ("nominals", "BP2,", ",", ["line 3, column id", "missing"]),
    ("nominals", "-731.317", "nan", ["line 3 (BP2), column y", "'nan'"]),
    ("nominals", "-731.317", "about 700", ["line 3 (BP2), column y", "'about 700'"]),
    ("nominals", "-731.317", '"-731,317"', ["line 3 (BP2), column y", "decimal comma"]),
    ("nominals", "8.50,1.2", "-8.50,1.2", ["line 3 (BP2), column diameter", "-8.5"]),
    ("nominals", "8.50,1.2", "0.0085,0.0012", ["line 3 (BP2)", "metres"]),
    ("nominals", "xyzd,2.0,2.0,2.0,0.2,", "xyzd,2.0,-2.0,2.0,0.2,", ["column tol_y", "-2"]),
    ("cell", "approach_mm: 20.0", "approach_mm: -20.0", ["approach_mm", "-20"]),
    ("cell", "settle_s: 0.2", "settle_s: soon", ["robot.settle_s", "'soon'"]),
    ("cell", "model: ur10e", "model: kr6", ["robot.model", "'ur10e'", "'kr6'"]),
    ("cell", "speed_rad_per_s: 1.0", "speed_rad_per_s: 60", ["robot.speed_rad_per_s", "3.2", "60"]),
    ("cell", "exposure_ring_s: 0.008", "exposure_ring_s: 8", ["camera.exposure_ring_s", "came 8"]),
    ("cell", "digital_output_laser: 1", "digital_output_laser: 0", ["robot", "an output each"]),
    ("cell", "driver: sim", "driver: ur", ["robot", "needs its `address`"]),
    ("cell", "scene: scene.yaml", "timeout_s: 1", ["camera", "needs its `scene`"]),
    ("cell", "[95.0, 225.0]", "[225.0, 95.0]", ["limits.joints_deg[0]", "lower limit before"]),
    ("cell", "home_deg: [137.939", "home_deg: [37.939", ["home_deg", "joint 1", "37.939"]),
    ("cell", "max: [1100.0, 600.0", "max: [1100.0, -900.0", ["limits.workspace.max", "above"]),
    ("active", "set: ", "set: x", ["there is no set 'x"]),
    ("hand_eye", "0.977216621", "0.877216621", ["flange_from_camera", "rotation"]),
    ("hand_eye", "20235500417", "20235500999", ["robot.serial", "20235500999"]),
    ("hand_eye", "flange_from_camera", "flange_to_camera", ["'flange_to_camera' is unknown"]),
    ("sensor", "[768, 576]", "[768]", ["image_size"]),
    ("sensor", "[768, 576]", "[768, 576000]", ["image_size", "576000"]),
    ("body", "0.999546158", "1e-05", ["base_from_body", "rotation"]),
])
def test_a_wrong_document_ends_with_2_and_one_clear_message(cell, workplace, document, old, new,
                                                            words):
    workplace.replace(workplace.documents[document], old, new)
    code, out, err = cell("check", "jobs/demo.yaml", "--json")
    assert code == 2
    answer = json.loads(out)
    assert answer["ok"] is False
    assert answer["reason"] == "bad_input"
    assert not [word for word in words if word not in answer["detail"]], answer["detail"]
    assert err.count("error:") == 1
    assert "Traceback" not in err


@pytest.mark.parametrize("document", DOCUMENTS)
@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe\x00\x01", b"{" * 4000,
                                     b"a: &a [1]\n" + b"".join(
                                         b"b%d: &b%d [*a, *a]\n" % (i, i) for i in range(50))])
def test_no_content_of_any_file_leads_past_a_clear_refusal(cell, workplace, document, content):
    file = workplace.documents[document]
    file.chmod(0o644)
    if content is None:
        file.unlink()
    else:
        file.write_bytes(content)
    code, _, err = cell("check", "jobs/demo.yaml")
    assert code == 2, err
    assert file.name in " ".join(err.split())
    assert "Traceback" not in err


def test_recordings_that_could_not_be_written_are_found_before(cell, workplace):
    (workplace.folder / "logs").write_text("a file")
    code, _, err = cell("check", "jobs/demo.yaml")
    assert code == 2
    assert "expected a folder" in err


def test_a_hole_without_a_stop_is_named(cell, workplace):
    workplace.replace(workplace.job, "  - {hole: BP1}\n", "")
    code, _, err = cell("check", workplace.job)
    assert code == 0
    assert "no stop for: BP1\n" in err
