"""`cell study` from the outside: tables in, tables or JSON out, and an exit code."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from cell.cli.door import app
from cell.core.errors import DocumentError
from cell.programs.study import read_samples


def _ask(*words):
    return CliRunner().invoke(app, ["study", *map(str, words)])


def _write(path, header, rows):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


@pytest.fixture
def table_1(tmp_path):
    return _write(tmp_path / "table1.csv", "id,x,y,z", [
        ("P1", 3390.8318, -591.1496, 768.7088), ("P1", 3390.8185, -591.1471, 768.6957),
        ("P1", 3390.8147, -591.1535, 768.6960), ("P1", 3390.8258, -591.1533, 768.6916),
        ("P1", 3390.7943, -591.1505, 768.6867)])


def test_repeatability_of_the_papers_table(table_1):
    answer = _ask("repeatability", table_1, "--json")
    sds = [round(s["answer"]["spread"]["sd"], 4) for s in json.loads(answer.stdout)["studies"]]
    assert answer.exit_code == 0 and sds == [0.0143, 0.0027, 0.0082]


def test_five_values_carry_no_cg(table_1):
    answer = _ask("type1", table_1, "--reference", "x=3390.861", "--tolerance", 1.0, "--json")
    (study,) = json.loads(answer.stdout)["studies"]
    assert answer.exit_code == 1 and "at least 25" in study["refused"] and "answer" not in study


def test_type1_says_capable_or_not(tmp_path):
    values = np.random.default_rng(1).normal(12.0, 0.01, 50)
    table = _write(tmp_path / "master.csv", "id,d", [("ring", f"{v:.5f}") for v in values])
    assert _ask("type1", table, "--reference", "d=12.0", "--tolerance", 0.8).exit_code == 0
    late = _ask("type1", table, "--reference", "d=12.07", "--tolerance", 0.8)
    assert late.exit_code == 1 and "not capable" in late.stdout


def test_type3_and_the_split_read_their_labels(tmp_path):
    chance = np.random.default_rng(6)
    rows = [("H1", 5.0 + part + chance.normal(0, 0.01), part, place, turn)
            for part in range(5) for place in "ab" for turn in "12" for _ in range(2)]
    table = _write(tmp_path / "parts.csv", "id,z,part,location,approach", rows)
    answer = json.loads(_ask("type3", table, "--tolerance", 1.0, "--json").stdout)
    assert answer["studies"][0]["answer"]["trials"] == 8
    split = json.loads(_ask("repeatability", table, "--json").stdout)["studies"][0]["answer"]
    assert [c["cause"] for c in split["components"]] == ["sensor", "robot", "location"]


def test_what_was_not_measured_is_left_out(tmp_path):
    table = _write(tmp_path / "t.csv", "id,x,y", [("A", 1.0, ""), ("A", "", 2.0), ("A", 3.0, "")])
    samples = {sample.axis: sample.values.tolist() for sample in read_samples([table])}
    assert samples == {"x": [1.0, 3.0], "y": [2.0]}


def test_a_reference_of_what_was_not_measured_is_refused(table_1):
    answer = _ask("type1", table_1, "--reference", "d=12.0", "--tolerance", 1.0)
    assert isinstance(answer.exception, DocumentError)
    assert "axis d nothing was measured; there is x, y, z" in str(answer.exception)


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty file"), ("id,x\n", "nothing was measured"),
    ("id,x\nA,\n", "nothing was measured"), ("name,x\nA,1\n", "column `id`"),
    ("id,x\nA,one\n", "line 2, column x"),
    ("id,x\nA,nan\n", "line 2"), (None, "cannot be read"),
])
def test_a_bad_table_is_refused_with_its_place(tmp_path, text, words):
    path = tmp_path / "bad.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(DocumentError, match=words):
        read_samples([path])


def test_recordings_are_parts(tmp_path):
    from made_cell import RecordedCell, demo_job, demo_papers

    papers = demo_papers()
    cell = RecordedCell({"demo": demo_job(papers)}, tmp_path, papers=papers,
                        deviation=lambda body, hole: "blurred" if hole == 1 else 0.1 * body)
    for body in ("A", "A", "B"):
        inspection = cell.begin(cell.jobs["demo"], body, trial=True).inspection
        inspection.measure_remaining(lambda hole: True)
        inspection.finish("complete")
    logs = sorted(tmp_path.glob("*.rrd"), key=lambda log: log.stat().st_mtime_ns)
    samples = {(s.feature, s.axis): s for s in read_samples(logs)}
    first, second = (hole for hole in papers.planned_holes[:2])
    found = samples[first.id, "x"]
    np.testing.assert_allclose(found.values, first.centre[0] + np.array([0.1, 0.2, 0.3]))
    assert found.labels == {"part": ("A", "A", "B")} and (second.id, "x") not in samples
