"""1,000 bodies over line, database and judging: accounted for, without growth, in their time."""

import gc
import random
import threading
import time

import psutil
import pytest
from made_cell import RecordedCell, demo_job, demo_papers
from made_shift_process import Archive

from cell.core.documents.shift import BodyType, MasterCheck, ShiftDocument
from cell.core.errors import DeviceError
from cell.core.ports import RobotStoppedError
from cell.line.modbus import ModbusLine
from cell.line.virtual_plc import VirtualBody, VirtualPlc
from cell.programs.results import FILE
from cell.programs.shift.books import Books
from cell.programs.shift.clock import WatchedClock
from cell.programs.shift.desk import Desk
from cell.programs.shift.machine import Shift
from cell.programs.shift.measuring import Measuring
from cell.results.database import open_database
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.tables import faults, visits

BODIES, WARM = 1000, 10


class Gauge:
    """Watches this process: memory and descriptors at chosen bodies, latencies of the verdict."""

    def __init__(self):
        self.process = psutil.Process()
        self.memory, self.files, self.bodies = {}, {}, 0

    def show(self, board):
        if len(board.last) and board.state == "ready" and board.last[-1].sequence != self.bodies:
            self.bodies = board.last[-1].sequence
            if self.bodies in (1, WARM) or self.bodies % 50 == 0:
                gc.collect()
                self.memory[self.bodies] = self.process.memory_info().rss
                self.files[self.bodies] = self.process.num_fds()


def _plant(chance):
    """A robot that stops, a camera that is lost, now and then, each once a body at most."""
    struck = set()

    def plant(body, hole):
        if hole == "home" or body in struck or chance.random() > 0.002:
            return
        struck.add(body)
        raise chance.choice([RobotStoppedError("bump", state="protective_stop"),
                             RobotStoppedError("guard", state="safeguard_stop"),
                             DeviceError("no image", device="camera")])
    return plant


def run_bodies(folder, bodies, show, seed=3):
    """Run so many bodies past a recorded cell, with a virtual PLC on the line."""
    chance = random.Random(seed)
    papers = demo_papers()
    document = ShiftDocument(name="soak", cell=papers.station.name,
                             bodies=(BodyType(type=1, job="demo.yaml"),),
                             master=MasterCheck(type=9, job="demo.yaml", every=200,
                                                limit_mm=100.0))
    cell = RecordedCell({"demo.yaml": demo_job(papers)}, None, papers=papers,
                        deviation=lambda body, hole: chance.choice(["blurred"] + [0.1] * 99),
                        plant=_plant(chance))
    database = open_database(folder / FILE)
    line = ModbusLine("127.0.0.1", 0)
    line.open()
    plc = VirtualPlc(line.endpoint, (VirtualBody(f"BODY{n:06d}", 1) for n in range(bodies)),
                     VirtualBody("MASTER", 9), lambda body: None, repair=0.0)
    with Books(database, None, folder) as books:
        desk = Desk(document, line, Ledger(database, cell.name, document.name), WatchedClock(),
                    show)
        shift = Shift(desk, cell, Measuring(desk, cell, books), Archive(database))
        plc.start()
        shift.run()
        settled = books.settle()
    plc.stop()
    line.close()
    return database, plc, shift, settled


def _check(folder, bodies):
    gauge, before = Gauge(), time.monotonic()
    threads, files = threading.active_count(), gauge.process.num_fds()
    children = set(gauge.process.children())
    database, plc, shift, settled = run_bodies(folder, bodies, gauge.show)
    took = time.monotonic() - before
    rows = Ledger(database, "demo", "soak").rows(visits)
    struck = Ledger(database, "demo", "soak").rows(faults)
    booked = list_bodies(database, Filter())
    database.close()
    assert plc.failure is None and settled and shift.done == bodies
    assert {row["state"] for row in rows} == {"released"} and len(booked) == len(rows)
    assert [r.sequence for r in plc.received] == [row["sequence"] for row in rows]
    assert [r.body.body_id for r in plc.received] == [row["body_id"] for row in rows]
    assert {row["recovered_by"] for row in struck} <= {"line"}
    assert threading.active_count() <= threads and gauge.process.num_fds() <= files
    assert set(gauge.process.children()) <= children
    return gauge, took, rows, struck


@pytest.mark.timeout(120)
def test_twenty_bodies_pass_the_line_the_books_and_the_judge(tmp_path):
    _, _, rows, _ = _check(tmp_path, 20)
    assert len(rows) == 21 and rows[0]["kind"] == "master"


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_thousand_bodies_do_not_grow(tmp_path, capsys):
    gauge, took, rows, struck = _check(tmp_path, BODIES)
    first, last = gauge.memory[WARM], gauge.memory[max(gauge.memory)]
    with capsys.disabled():
        print(f"\n{len(rows)} bodies (masters included), {len(struck)} faults in {took:.0f} s; "
              f"memory {first / 1e6:.1f} MB after {WARM}, {last / 1e6:.1f} MB at the end "
              f"({100 * (last / first - 1):+.1f} %), descriptors {gauge.files[WARM]} and "
              f"{gauge.files[max(gauge.files)]}")
    assert last < 1.05 * first and gauge.files[max(gauge.files)] == gauge.files[WARM]
