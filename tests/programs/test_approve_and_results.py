"""`cell approve` and `cell results` from the outside."""

import csv
import json

import pytest
from made_bodies import booking_of
from made_workplace import Workplace
from recorded_body import record_body
from typer.testing import CliRunner

from cell.cli.door import app
from cell.core.errors import DocumentError
from cell.programs.approve import approval_hashes, approve_job, withdraw_job
from cell.programs.results import opened
from cell.results.approvals import approved
from cell.results.booking import body_rows, book
from cell.results.query import Filter, list_bodies


def _ask(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Workplace.in_folder(tmp_path)


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir(exist_ok=True)
    with opened(folder) as database:
        for number in (1, 2, 3):
            with database.transaction() as connection:
                book(connection, body_rows(booking_of(number, deviations=(0.1 * number, None))))
    return folder


def test_an_approval_holds_until_a_letter_changes(place, logs):
    hashes = list(approval_hashes(place.papers().texts).values())
    answer = _ask("approve", place.job, "--by", "A. Meier", "--logs", logs, "--json")
    assert answer.exit_code == 0
    assert [row["kind"] for row in json.loads(answer.stdout)["approved"]] == [
        "job", "calibration", "cell"]
    with opened(logs) as database:
        assert approved(database, hashes)
    place.replace(place.nominals, "16.00", "16.01")
    changed = approval_hashes(place.papers().texts)
    with opened(logs) as database:
        assert not approved(database, list(changed.values()))
        assert approved(database, [changed["calibration"], changed["cell"]])


@pytest.mark.parametrize("document", ["job", "nominals", "cell", "body"])
def test_every_paper_counts(place, document):
    before = approval_hashes(place.papers().texts)
    file = place.documents[document]
    file.write_text(file.read_text() + ("\n# a word\n" if file.suffix == ".yaml" else "\n"))
    after = approval_hashes(place.papers().texts)
    assert sum(before[kind] != after[kind] for kind in before) == 1


def test_an_approval_can_be_withdrawn(place, logs):
    with opened(logs) as database:
        approve_job(database, place.job, "A. Meier")
        assert withdraw_job(database, place.job) == 1
        assert not approved(database, list(approval_hashes(place.papers().texts).values()))


def test_nobody_approves_nothing(place, logs):
    with opened(logs) as database:
        with pytest.raises(DocumentError, match="needs a name"):
            approve_job(database, place.job, "  ")
        place.replace(place.job, "cell: demo", "cell: elsewhere")
        with pytest.raises(DocumentError):
            approve_job(database, place.job, "A. Meier")


def test_results_are_listed_filtered_and_shown(logs):
    listed = json.loads(_ask("results", "list", "--logs", logs, "--last", 2, "--json").stdout)
    assert [body["body_id"] for body in listed["bodies"]] == ["BODY3", "BODY2"]
    assert "BODY1" in _ask("results", "list", "--logs", logs).stdout
    shown = json.loads(_ask("results", "show", "BODY2", "--logs", logs, "--json").stdout)
    assert {axis["feature"] for axis in shown["axes"]} == {"H0", "H1"}
    text = _ask("results", "show", "run-000002", "--logs", logs).stdout
    assert "no_stripe" in text and "0.200" in text
    trend = json.loads(_ask("results", "trend", "H0", "x", "--logs", logs, "--json").stdout)
    assert [p["deviation"] for p in trend["points"]] == pytest.approx([0.1, 0.2, 0.3])


def test_results_are_exported(logs, tmp_path):
    table = tmp_path / "out.csv"
    assert _ask("results", "export", table, "--logs", logs).exit_code == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len(rows) == 3 * 7 and rows[0]["time_utc"] == "2023-11-14T22:14:20Z"
    assert {row["reason"] for row in rows if row["feature"] == "H1"} == {"no_stripe"}


@pytest.mark.parametrize(("words", "said"), [
    (("results", "show", "nobody"), "no body or recording"),
    (("results", "list", "--job", "demmo"), "no body matches; the database holds 3, from 2023-11-"),
    (("results", "list", "--since", "2099-01-01", "--last", "1"), "no body matches"),
    (("results", "list", "--verdict", "good"), "expected in_tolerance, out_of_tolerance, "),
    (("results", "export", "-", "--until", "1999-01-01"), "no body matches"),
    (("results", "trend", "H9", "x"), "an axis 'x' of a feature 'H9'"),
    (("results", "trend", "H0", "x", "--since", "2099-01-01"), "no body that is asked for"),
    (("results", "export", "absent/out.csv"), "cannot be written")])
def test_what_is_not_there_is_said(logs, words, said):
    answer = _ask(*words, "--logs", logs)
    assert isinstance(answer.exception, DocumentError) and said in str(answer.exception)


def test_an_empty_database_is_listed_as_such(tmp_path):
    answer = _ask("results", "list", "--logs", tmp_path, "--last", 3, "--json")
    assert (answer.exit_code, json.loads(answer.stdout)) == (0, {"bodies": []})
    answer = _ask("results", "list", "--logs", tmp_path, "--production")
    assert "the database holds none yet" in str(answer.exception)


def test_results_without_a_folder_are_refused(tmp_path):
    answer = _ask("results", "list", "--logs", tmp_path / "absent")
    assert "no such folder" in str(answer.exception)


def test_a_rebuild_names_what_it_cannot_read(logs):
    (logs / "torn.rrd").write_bytes(b"no recording")
    answer = _ask("results", "rebuild", "--logs", logs, "--json")
    assert answer.exit_code == 1 and "torn.rrd" in json.loads(answer.stdout)["not_read"][0]


def test_a_folder_that_cannot_be_written_is_read(logs, monkeypatch):
    monkeypatch.setattr("os.access", lambda *_: False)  # for whom no permission counts, as well
    with opened(logs) as database:
        assert [body["body_id"] for body in list_bodies(database, Filter())] == [
            "BODY3", "BODY2", "BODY1"]


def test_recordings_that_are_not_in_the_database_are_counted(tmp_path, monkeypatch):
    """`cell run` writes no row: a shift or a rebuild takes its recordings in."""
    monkeypatch.setenv("CELL_SEAL_KEY", str(tmp_path / "absent.key"))
    log = record_body(tmp_path / "body.rrd", holes=())
    (tmp_path / "body.pruned.rrd").write_bytes(log.read_bytes())  # the same body
    answer = _ask("results", "list", "--logs", tmp_path)
    assert answer.exit_code == 0 and "1 recordings here are not in the database" in answer.stderr
    _ask("results", "rebuild", "--logs", tmp_path)
    assert "are not in" not in _ask("results", "list", "--logs", tmp_path).stderr


def test_an_approval_needs_a_folder_that_can_be_written(place, tmp_path):
    (tmp_path / "file").touch()
    answer = _ask("approve", place.job, "--by", "A. Meier", "--logs", tmp_path / "file")
    assert "came a file" in str(answer.exception)
