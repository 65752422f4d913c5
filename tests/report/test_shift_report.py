"""The page and the table of a shift, from rows alone."""

import csv
import io

import pytest

from cell.report.shift import Disk, ShiftFacts, shift_csv, shift_report


def _visit(sequence, **changes):
    return {"sequence": sequence, "body_id": f"BODY{sequence}", "body_type": 1, "kind": "body",
            "verdict": "in_tolerance", "state": "released", "trial": False, "measured": 24,
            "out_of_tolerance": 0, "missing": 0, "worst": 0.25, "arrived": 1.7e9 + 100 * sequence,
            "judged": 1.7e9 + 100 * sequence + 40.0, "recording_id": f"run-{sequence}",
            "reason": ""} | changes


def _facts(**changes):
    visits = [_visit(1, kind="master", reason="master check passed: 0.05 mm at H1.x"), _visit(2),
              _visit(3, verdict="out_of_tolerance", worst=0.9, judged=1.7e9 + 370.0),
              _visit(4, verdict="incomplete", reason="aborted <by> the line", state="judged"),
              _visit(5, kind="bypassed", verdict="incomplete", worst=None)]
    return ShiftFacts(**{
        "name": "early", "cell": "demo", "began": 1.7e9, "ended": 1.7e9 + 3600, "takt": 60.0,
        "visits": visits, "faults": [], "bypasses": [], "notices": [], "failing": [],
        "refusals": [], "calibrations": [], "seal": "", "disk": Disk(10**9, 0, 0)} | changes)


def test_bodies_are_counted_without_the_master():
    facts = _facts()
    assert facts.verdicts == {"in_tolerance": 1, "out_of_tolerance": 1, "uncertain": 0,
                              "incomplete": 2}
    assert facts.seconds == [40.0, 70.0, 40.0] and facts.over_takt == 1
    assert facts.mean_seconds == pytest.approx(50.0)


def test_the_page_is_whole_and_lets_nothing_in():
    page = shift_report(_facts(
        faults=[{"at": 1.7e9, "state": "camera_lost", "detail": "<script>", "recovered_at": None,
                 "recovered_by": None}],
        bypasses=[{"since": 1.7e9 + 450, "until": 1.7e9 + 900, "ended": None, "requested_by": "17",
                   "reason": "window broken"}],
        failing=[{"feature": "H7", "axis": "x", "times": 3, "worst": 0.91, "mean": -0.8}],
        refusals=[{"feature": "H9", "reason": "no_laser", "times": 2}],
        calibrations=[{"set_id": "set-1", "hash": "ab" * 32, "first_used": 1.7e9, "bodies": 4}],
        notices=[{"at": 1.7e9, "kind": "clock", "detail": "the clock was set back by 60.0 s"}]))
    for words in ("camera lost", "not recovered", "window broken", "BODY5 </tr>", "H7", "-0.800",
                  "no laser", "set back", "set-1", "master check passed", "[judged]"):
        assert words in page, words
    assert "<script>" not in page and "&lt;by&gt;" in page and "http" not in page
    assert "TRIAL" not in page


def test_trials_are_announced_on_top():
    assert "2 of 2 bodies" in shift_report(_facts(visits=[_visit(1, trial=True),
                                                          _visit(2, trial=True)]))


def test_an_empty_shift_has_a_page_too():
    assert "None." in shift_report(_facts(visits=[], takt=None))


def test_the_disk_forecast_counts_in_bodies():
    assert Disk(1_000_000, 30_000, 3).bodies_left == 100
    assert Disk(1_000_000, 0, 0).bodies_left is None
    assert "room for about 100 more bodies" in shift_report(_facts(disk=Disk(1_000_000, 30_000, 3)))


def test_the_table_has_a_line_a_body():
    rows = list(csv.DictReader(io.StringIO(shift_csv(_facts()))))
    assert [row["body_id"] for row in rows] == [f"BODY{n}" for n in range(1, 6)]
    assert (rows[2]["seconds"], rows[2]["worst"], rows[2]["time_utc"]) \
        == ("70.0", "0.9", "2023-11-14 22:18:20")
    assert rows[4]["worst"] == ""
