"""Fifty bodies on the virtual cell with a fault every few bodies: all of them accounted for."""

import gc
import threading
import time
from statistics import median

import psutil
import pytest
from made_station_shift import Cause, short_shift

from cell.programs.results import opened
from cell.programs.shift.run import ShiftRequest, run_shift
from cell.recording import read
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.tables import faults, visits

BODIES, EVERY, WARM, SPEED = 50, 4, 10, 20.0
HOLES = ("BP5", "BP1", "BP3", "BP2", "SI3", "SI4")
STATES = {"protective_stop": {"protective_stop"}, "safeguard": {"safeguard_stop"},
          "emergency_stop": {"emergency_stop"}, "cut": {"robot_lost"}, "pause": {"paused"},
          "kill_program": {"robot_lost", "robot_failed"}}


class Soak(Cause):
    """Strikes every few bodies, lets switches go again, and reads the gauges."""

    def __init__(self, address):
        names = list(STATES)
        moments = {(f"BODY{number:06d}", 1 + index % 4): names[index % len(names)]
                   for index, number in enumerate(range(3, BODIES + 1, EVERY))}
        super().__init__(address, moments)
        self.process, self.memory, self.files, self.seen = psutil.Process(), {}, {}, 0

    def tell(self, command):
        switched = command in ("safeguard", "emergency_stop")
        super().tell(f"{command} on" if switched else command)
        if switched:
            threading.Timer(1.0, super().tell, [f"{command} off"]).start()

    def show(self, board):
        super().show(board)
        if board.last and board.state == "ready" and board.last[-1].sequence != self.seen:
            self.seen = board.last[-1].sequence
            gc.collect()
            self.memory[self.seen] = self.process.memory_info().rss
            self.files[self.seen] = self.process.num_fds()


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_fifty_bodies_with_faults(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _, shift, address = short_shift(tmp_path, 2, HOLES)
    logs, soak, me = tmp_path / "logs", Soak(address), psutil.Process()
    before, began = (threading.active_count(), me.num_fds(), me.children()), time.monotonic()
    done = run_shift(ShiftRequest(shift, logs, simulate=True, bodies=BODIES, speed=SPEED),
                     soak.show, print)
    took = time.monotonic() - began
    with opened(logs) as database:
        ledger = Ledger(database, "demo", "short")
        came, struck, booked = ledger.rows(visits), ledger.rows(faults), list_bodies(database,
                                                                                     Filter())
    after = threading.active_count(), me.num_fds(), me.children(recursive=True)
    growth = soak.memory[max(soak.memory)] / soak.memory[WARM] - 1
    files = soak.files[WARM], soak.files[max(soak.files)]
    late = [row["judged"] - read(logs / f"{row['recording_id']}.rrd").holes[-1]
            .observation.views[-1].time for row in came[:10]]
    with capsys.disabled():
        print(f"\n{len(came)} bodies in {took:.0f} s, {len(struck)} faults of {len(soak.struck)} "
              f"caused: {[row['state'] for row in struck]}; memory {soak.memory[WARM] / 1e6:.0f} "
              f"MB after {WARM} bodies, {100 * growth:+.1f} % at the end; descriptors {files}; "
              f"before {before}, after {after}; last image to verdict {median(late):.2f} s median, "
              f"{max(late):.2f} s at most")
    assert done.bodies == BODIES == len(came) == len(booked) and done.all_booked
    assert {row["state"] for row in came} == {"released"}
    assert all(row["measured"] + row["missing"] == len(HOLES) for row in came)
    assert len(soak.struck) == len(range(3, BODIES + 1, EVERY)) <= len(struck)
    assert all(row["recovered_at"] for row in struck)
    assert growth < 0.05 and files[0] == files[1] and after == before
