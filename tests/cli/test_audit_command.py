"""`cell audit`, `repair`, `prune`, `seal-key`: words in, words out, an exit code."""

import json
from itertools import count
from pathlib import Path

import pytest
from recorded_body import measured_anew, record_body

import cell.programs.audit.log as log_audit
from cell.cli.door import main


@pytest.fixture
def keys(tmp_path, monkeypatch):
    monkeypatch.setenv("CELL_SEAL_KEY", str(tmp_path / "keys" / "seal.key"))
    return tmp_path / "keys"


@pytest.fixture
def cell(monkeypatch, capsys):
    """Run a command: (exit code, what it said on standard output)."""
    def run(*words):
        monkeypatch.setattr("sys.argv", ["cell", *map(str, words)])
        with pytest.raises(SystemExit) as leave:
            main()
        return leave.value.code or 0, capsys.readouterr().out
    return run


def test_a_key_is_made_once_and_shown(cell, keys):
    assert cell("seal-key", "show")[0] == 2
    code, words = cell("seal-key", "new", "--json")
    made = json.loads(words)
    assert (code, len(made["id"]), made["public_key"][:10]) == (0, 16, "-----BEGIN")
    assert json.loads(cell("seal-key", "show", "--json")[1]) == made
    assert cell("seal-key", "new")[0] == 2


def test_a_signed_recording_passes_with_its_key_and_no_other(cell, keys, tmp_path):
    cell("seal-key", "new")
    log = record_body(tmp_path / "logs.rrd", holes=())
    (tmp_path / "other.pub").write_text((keys / "seal.pub").read_text())
    assert cell("audit", log, "--key", keys / "seal.pub")[0] == 0
    (keys / "seal.key").rename(keys / "old.key")
    cell("seal-key", "new")
    assert cell("audit", log, "--key", keys / "seal.pub")[0] == 2
    assert cell("audit", log, "--key", keys / "absent.pub")[0] == 2


def test_audit_says_it_in_words_and_in_json(cell, keys, tmp_path):
    log = record_body(tmp_path / "body.rrd")
    code, words = cell("audit", log)
    assert code == 0
    assert "identical" in words
    assert "hashes only" in words
    code, words = cell("audit", log, "--strict", "--json")
    (answer,) = json.loads(words)["logs"]
    assert (code, answer["answer"], answer["holes"]) == (0, "identical", 3)
    assert answer["numbers"]["differs"] == 0


def test_audit_of_a_folder_prints_the_head_and_refuses_what_is_out_of_place(cell, keys, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    record_body(folder / "a.rrd", holes=())
    code, words = cell("audit", folder, "--json")
    (row,) = json.loads(words)["folders"]
    assert (code, row["findings"], len(row["head"])) == (0, [], 64)
    (folder / "stranger.rrd").write_bytes(b"RRF2")
    code, words = cell("audit", folder)
    assert code == 2
    assert "unsealed stranger.rrd" in words


def test_a_what_if_shows_what_turns_and_changes_nothing(cell, keys, tmp_path):
    log = record_body(tmp_path / "body.rrd")
    before = log.read_bytes()
    code, words = cell("audit", log, "--method", "two-step", "--json")
    (answer,) = json.loads(words)["logs"]
    assert {change["feature"] for change in answer["changes"]} == {"BP2", "SI3", "QP2"}
    assert code == int(any(change["turns"] for change in answer["changes"]))
    assert log.read_bytes() == before


def test_a_fault_of_the_program_ends_with_70_and_the_others_are_audited(cell, keys, tmp_path,
                                                                        monkeypatch, capsys):
    (tmp_path / "logs").mkdir()
    for name in ("a", "b", "c"):
        record_body(tmp_path / "logs" / f"{name}.rrd", holes=measured_anew()[1][:1])
    measure, calls = log_audit.measure_hole, count()

    def stumble(*given):
        """Fail at the second recording."""
        if next(calls) == 1:
            raise KeyError("nowhere")
        return measure(*given)

    monkeypatch.setattr(log_audit, "measure_hole", stumble)
    monkeypatch.setattr("sys.argv", ["cell", "audit", str(tmp_path / "logs"), "--json"])
    with pytest.raises(SystemExit, match="70"):
        main()
    said = capsys.readouterr()
    logs = {Path(each["log"]).name: each for each in json.loads(said.out)["logs"]}
    assert {name: each["answer"] for name, each in logs.items()} == {
        "a.rrd": "identical", "b.rrd": "failed", "c.rrd": "identical"}
    assert "KeyError" in logs["b.rrd"]["problem"]
    assert "b.rrd: a fault of the program" in said.err
    assert 'raise KeyError("nowhere")' in said.err


def test_an_audit_of_nothing_is_refused(cell, keys, tmp_path):
    log = record_body(tmp_path / "body.rrd", holes=())
    assert cell("audit", log, "--since", "2020-01-01")[0] == 0
    code, words = cell("audit", log, "--since", "2099-01-01", "--json")
    answer = json.loads(words)
    assert (code, answer["ok"]) == (2, False)
    assert "none of 1 recordings began since 2099-01-01 00:00" in answer["detail"]


@pytest.mark.parametrize("words", [["audit", "nowhere.rrd"], ["repair", "nowhere.rrd"],
                                   ["prune", "nowhere.rrd"], ["view", "nowhere.rrd"],
                                   ["audit", ".", "--since", "lately"],
                                   ["audit", ".", "--calibration", "none"],
                                   ["audit", ".", "--method", "guess"]])
def test_bad_input_ends_with_2_and_one_json_object(cell, keys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    code, said = cell(*words)
    assert (code, said) == (2, "")
    if words[0] == "audit":
        assert json.loads(cell(*words, "--json")[1])["ok"] is False


def test_repair_and_prune(cell, keys, tmp_path):
    log = record_body(tmp_path / "body.rrd")
    torn = tmp_path / "torn.rrd"
    torn.write_bytes(log.read_bytes()[:-300_000])
    assert cell("audit", torn)[0] == 2
    code, words = cell("repair", torn, "--json")
    assert (code, json.loads(words)["holes"]) == (0, 2)
    assert cell("repair", log)[0] == 2
    assert cell("audit", tmp_path / "torn.repaired.rrd")[0] == 0
    assert json.loads(cell("prune", log, "--json")[1])["bytes"] < log.stat().st_size / 5
