"""What an audit costs: holes a second, where the time goes, two workers against one, memory."""

import subprocess
import sys
import time
from dataclasses import replace

import pytest
from recorded_body import long_body, record_body

from cell.programs.audit import log as audit_module
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question
from cell.programs.audit.spread import audit_each
from cell.recording import pages
from cell.recording.guard import processes

pytestmark = [pytest.mark.bench, pytest.mark.timeout(900)]


def record_long(path, count=24):
    start, holes = long_body(count)
    return record_body(path, replace(start, recording_id=path.stem), holes)


def timed(monkeypatch, module, name, spent):
    """Count the processor seconds that a function takes."""
    inner = getattr(module, name)

    def outer(*arguments):
        began = time.process_time()
        try:
            return inner(*arguments)
        finally:
            spent[name] = spent.get(name, 0.0) + time.process_time() - began

    monkeypatch.setattr(module, name, outer)


def test_holes_a_second_and_where_the_time_goes(tmp_path, monkeypatch, capsys):
    log = record_long(tmp_path / "body.rrd")
    audit_log(log)
    began = time.process_time()
    plain = audit_log(log)
    total = time.process_time() - began
    spent = {}
    for module, name in ((pages, "_decode"), (pages, "pixel_hash"), (pages, "link"),
                         (audit_module, "measure_hole"), (audit_module, "judge_run")):
        timed(monkeypatch, module, name, spent)
    began = time.process_time()
    audit_log(log)
    rest = time.process_time() - began - sum(spent.values())
    with capsys.disabled():
        print(f"\naudit: {plain.holes / total:.1f} holes/s on one core ({plain.answer}); a hole "
              "takes " + ", ".join(f"{name.strip('_')} {1e3 * seconds / plain.holes:.1f} ms"
                          for name, seconds in (spent | {"read and compare": rest}).items()))
    assert plain.answer == "identical"


def test_two_workers_against_one(tmp_path, capsys):
    logs = [record_long(tmp_path / f"{name}.rrd") for name in "abcd"]
    seconds = {}
    for count in (1, 2):
        with processes(count) as executor:
            list(audit_each(logs[:count], Question(), executor))  # started and imported
            began = time.perf_counter()
            answers = [audit.answer for audit in audit_each(logs, Question(), executor)]
            seconds[count] = time.perf_counter() - began
        assert answers == ["identical"] * len(logs)
    with capsys.disabled():
        print(f"\naudit: two workers {seconds[1] / seconds[2]:.2f} times one")


PEAK = """
import resource, sys
from pathlib import Path
from cell.programs.audit.log import audit_log
audit = audit_log(Path(sys.argv[1]))
print(audit.holes, audit.answer, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def test_memory_for_two_hundred_holes(tmp_path, capsys):
    log = record_long(tmp_path / "long.rrd", 200)
    said = subprocess.run([sys.executable, "-c", PEAK, str(log)], capture_output=True, text=True,
                          check=True).stdout.split()
    with capsys.disabled():
        print(f"\naudit: peak {float(said[2]):.0f} MB for {said[0]} holes, "
              f"{log.stat().st_size / 1e6:.0f} MB of recording")
    assert said[:2] == ["200", "identical"]
