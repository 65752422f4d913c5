"""The door: whatever goes wrong, one exit code and, with --json, one object."""

import json
import os
import signal
import subprocess
import sys

import pytest

from cell.cli import door


@pytest.mark.parametrize("words", [("run",), ("locate", "--radius", "1"), ("nothing",),
                                   ("compare", "a.csv", "b.csv", "--loud")])
def test_wrong_words_are_answered_too(cell, words):
    code, out, err = cell(*words, "--json")
    assert code == 2
    assert json.loads(out)["reason"] == "bad_input"
    assert "Usage" in err


@pytest.mark.parametrize(("thrown", "code", "reason"), [
    (KeyboardInterrupt(), 130, "interrupted"), (EOFError(), 130, "interrupted"),
    (BrokenPipeError(32, "a pipe of the program's own"), 70, "program_fault"),
    (ZeroDivisionError("nobody expected it"), 70, "program_fault")])
def test_what_nobody_caught_never_reads_as_a_verdict(cell, monkeypatch, thrown, code, reason):
    def stumble(*_):
        raise thrown

    monkeypatch.setattr("cell.archive.files.read_bytes", stumble)
    left, out, _ = cell("compare", "a.csv", "b.csv", "--json")
    assert left == code
    assert json.loads(out)["reason"] == reason


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_background_job_can_be_stopped(number):
    def ignore():
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does to what it sends to the back

    process = subprocess.Popen([sys.executable, "-m", "cell", "sim", "--json"], preexec_fn=ignore,
                               stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert json.loads(process.stdout.readline())["ok"] is True
        os.kill(process.pid, number)
        process.wait(30)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert process.returncode == 0


def test_a_second_interrupt_does_not_break_off_the_closing():
    interrupt = door._Interrupt()
    with pytest.raises(KeyboardInterrupt):
        interrupt(signal.SIGINT, None)
    interrupt(signal.SIGINT, None)
    interrupt._next = 0.0  # as if the closing had taken too long
    with pytest.raises(KeyboardInterrupt):
        interrupt(signal.SIGTERM, None)


@pytest.mark.parametrize(("redirection", "code"), [
    ("| true", 0), (">&-", 0), ("--json >&-", 0), ("--json | true", 0), ("2>&- >&- <&-", 0),
    ("> /dev/full", 4), ("--json > /dev/full", 4)])
def test_an_answer_that_nobody_reads_is_no_fault(tmp_path, redirection, code):
    (tmp_path / "a.csv").write_text("id,x,y,z\nA,1,2,3\n")
    line = f"set -o pipefail; {sys.executable} -m cell compare a.csv a.csv {redirection}"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True,
                          stdin=subprocess.DEVNULL, timeout=60, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert ("cannot be written to standard output" in done.stderr) == (code == 4)


@pytest.mark.parametrize(("words", "redirection", "code"), [
    ("compare a.csv nowhere.csv", "2> >(true)", 2),
    ("compare a.csv nowhere.csv", "2> /dev/full", 2),
    ("--help", "| true", 0), ("compare --help", "| true", 0), ("results", "2>&1 | true", 2),
    ("--help", "> /dev/full", 4), ("--version", "> /dev/full", 4), ("--version", "| true", 0)])
def test_no_reader_of_words_or_help_changes_the_exit_code(tmp_path, words, redirection, code):
    (tmp_path / "a.csv").write_text("id,x,y,z\nA,1,2,3\n")
    line = f"set -o pipefail; {sys.executable} -m cell {words} {redirection}"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True,
                          stdin=subprocess.DEVNULL, timeout=60, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_words_that_are_no_text_are_refused(cell_folder, encoding):
    """Bytes of another encoding could neither be recorded nor found again."""
    own = {"LC_ALL": "C", "PYTHONUTF8": str(int(encoding == "utf-8")), "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run([sys.executable, "-m", "cell", "run", "jobs/demo.yaml", "--json",
                           "--body", "Größe".encode("latin-1")], cwd=cell_folder,
                          capture_output=True, timeout=60, check=False, env=os.environ | own)
    assert done.returncode == 2
    assert f"encoding of this locale, {encoding}" in json.loads(done.stdout)["detail"]


def test_a_narrow_encoding_and_terminal_cost_no_number(tmp_path):
    (tmp_path / "a.csv").write_text("id,x,y,z\nA,1,2,3\n")
    narrow = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "20", "TERM": "dumb"}
    done = subprocess.run([sys.executable, "-m", "cell", "compare", "a.csv", "a.csv"],
                          cwd=tmp_path, capture_output=True, timeout=60, check=True, env=narrow)
    assert done.stdout.count(b"+0.0000") >= 3


def test_the_reasons_cover_every_code():
    assert set(door.REASONS) == {2, 3, 4, 70, 130}
