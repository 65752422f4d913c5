"""A shift on the virtual cell from end to end: line, robot, camera, recording, books, report."""

import json
import threading

import pytest
from made_station_shift import Cause, short_shift
from typer.testing import CliRunner

from cell.cli.door import app
from cell.programs.approve import approve_job
from cell.programs.results import opened, rebuild
from cell.programs.shift.run import ShiftRequest, run_shift
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.tables import faults, visits


def _rows(logs, table):
    with opened(logs) as database:
        return Ledger(database, "demo", "short").rows(table)


def _bodies(logs):
    with opened(logs) as database:
        return list_bodies(database, Filter())


@pytest.mark.timeout(300)
def test_a_shift_measures_stands_recovers_and_reports(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    place, shift, address = short_shift(tmp_path, 1, more="master: {type: 9, job: demo.yaml, "
                                        "every: 1, limit_mm: 5.0}\n")
    logs = tmp_path / "logs"
    logs.mkdir()
    with opened(logs) as database:
        approve_job(database, place.job, by="A. Meier", cell="demo")
    cause = Cause(address, {("BODY000001", 2): "protective_stop"})
    standing = []

    def show(board):
        cause.show(board)
        if board.fault:
            standing.append(cause.truth())
    done = run_shift(ShiftRequest(shift, logs, simulate=True, bodies=1, speed=20.0), show, print)
    assert done.bodies == 1 and done.all_booked and cause.struck == ["protective_stop"]
    _check_ledger(logs)
    booked = _bodies(logs)
    assert [b["body_id"] for b in booked] == ["BODY000001", "MASTER"]
    assert all(len(b["seal"]) == 64 and not b["trial"] for b in booked)
    with opened(logs) as database:
        assert rebuild(database, logs, lambda done, of: None) == []
    assert [{**b, "key": 0} for b in _bodies(logs)] == [{**b, "key": 0} for b in booked]
    assert standing and not any(truth["outputs"] & 0b11 for truth in standing), "lights off"
    assert all(max(map(abs, truth["joint_speeds"])) < 1e-3 for truth in standing), "the arm rests"
    _check_report(logs, shift)
    assert not [t for t in threading.enumerate() if t.name in ("line", "virtual-plc", "results")]


def _check_ledger(logs):
    came = _rows(logs, visits)
    assert [(v["body_id"], v["kind"], v["state"], v["trial"]) for v in came] == [
        ("MASTER", "master", "released", False), ("BODY000001", "body", "released", False)]
    (fault,) = _rows(logs, faults)
    assert fault["state"] == "protective_stop" and fault["recovered_at"] > fault["at"]
    assert came[1]["measured"] == 3, "the body went on at the hole where it stopped"


def _check_report(logs, shift):
    answer = CliRunner().invoke(app, ["shift", str(shift), "--report", "--logs", str(logs),
                                      "--json"])
    written = json.loads(answer.stdout)
    from pathlib import Path
    page, table = (Path(written[name]).read_text() for name in ("report", "csv"))
    assert "protective stop" in page and "BODY000001" in page and "2026-11-20a" in page
    assert "http" not in page and "TRIAL" not in page
    assert table.splitlines()[0].startswith("sequence,time_utc,body_id") \
        and len(table.splitlines()) == 3
