"""The ledger and the writer: nothing twice, nothing lost, nobody waits."""

import sqlite3
import threading
import time

import pytest
from made_bodies import booking_of

from cell.results.booking import body_rows, book
from cell.results.database import open_database
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.summary import Window, rank_failing, rank_refusals
from cell.results.tables import bypasses, faults, notices, visits
from cell.results.writer import Writer


@pytest.fixture
def ledger(database):
    return Ledger(database, "demo", "early-shift")


def _arrival(number=1):
    return {"body_id": f"BODY{number}", "body_type": 1, "kind": "body", "arrived": 1.7e9 + number,
            "trial": True}


def test_sequence_numbers_go_on_over_shifts_and_belong_to_a_cell(ledger, database):
    assert [ledger.arrive(_arrival(n))["sequence"] for n in (1, 2)] == [1, 2]
    assert Ledger(database, "demo", "late-shift").arrive(_arrival(3))["sequence"] == 3
    assert Ledger(database, "other", "late-shift").arrive(_arrival(3))["sequence"] == 1


def test_what_the_line_has_not_acknowledged_is_found_again(ledger, database):
    first, second, third = (ledger.arrive(_arrival(n)) for n in (1, 2, 3))
    ledger.update_visit(first, state="released", released=1.7e9 + 50)
    ledger.update_visit(second, state="judged", verdict="in_tolerance", judged=1.7e9 + 60)
    found = Ledger(database, "demo", "after-a-crash").open_visits()
    assert [(v["sequence"], v["state"]) for v in found] == [(2, "judged"), (3, "measuring")]
    assert found[1] == third


def test_the_masters_holes_are_not_ranked_among_the_bodies(ledger, database):
    ledger.arrive({**_arrival(1), "kind": "master", "recording_id": "run-000001"})
    for number in (1, 2):
        with database.transaction() as connection:
            book(connection, body_rows(booking_of(number)))
    window = Window("demo", 0.0, 2e9)
    assert [row["times"] for row in rank_failing(database, window)] == [1]
    assert [row["times"] for row in rank_refusals(database, window)] == [1]


def test_a_fault_and_a_bypass_say_who_and_how_long(ledger):
    fault = ledger.open_fault("protective_stop", 21, "joint 3", at=5.0, sequence=4)
    ledger.close_fault(fault, by="A. Meier", at=65.0)
    (row,) = ledger.rows(faults)
    assert (row["recovered_by"], row["recovered_at"] - row["at"]) == ("A. Meier", 60.0)
    bypass = ledger.open_bypass("17", "sensor window broken", since=7.0, until=1807.0)
    assert ledger.current_bypass() == bypass
    ledger.close_bypass(bypass, by="A. Meier", at=900.0)
    assert ledger.current_bypass() is None and ledger.rows(bypasses)[0]["ended"] == 900.0


def test_the_latest_time_in_the_ledger_shows_a_clock_that_stepped_back(ledger):
    assert ledger.last_time() is None
    ledger.arrive(_arrival(1))
    ledger.note("takt", "late", at=1.7e9 + 33)
    assert ledger.last_time() == 1.7e9 + 33
    assert [row["detail"] for row in ledger.rows(notices)] == ["late"]


def test_a_mirror_gets_every_entry_and_again_after_a_crash(ledger, tmp_path):
    plant = open_database(tmp_path / "plant.sqlite")
    writer = Writer(plant)
    mirrored = Ledger(ledger.database, "demo", "early-shift", writer.submit)
    visit = mirrored.arrive(_arrival(1))
    mirrored.update_visit(visit, state="released", released=1.0)
    mirrored.note("clock", "stepped back", at=2.0)
    mirrored.repeat_to_mirror()
    assert writer.close()
    copy = Ledger(plant, "demo", "x")
    assert copy.rows(visits) == ledger.rows(visits) and copy.rows(notices) == ledger.rows(notices)
    plant.close()


def test_the_writer_books_in_order_and_reports_what_is_refused(database):
    writer = Writer(database)
    broken = body_rows(booking_of(2))
    broken.features[0]["feature"] = None
    for rows in (body_rows(booking_of(1)), broken, body_rows(booking_of(3))):
        writer.submit(lambda connection, rows=rows: book(connection, rows))
    assert not writer.close()
    assert len(writer.refused) == 1 and writer.pending() == 0
    assert [b["body_id"] for b in list_bodies(database, Filter())] == ["BODY3", "BODY1"]


def test_a_locked_database_delays_nobody_and_loses_nothing(tmp_path):
    path = tmp_path / "results.sqlite"
    database = open_database(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cell.results.database.WAIT", 0.2)
        hurried = open_database(path)
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    other.execute("BEGIN IMMEDIATE")
    threading.Timer(1.0, lambda: other.execute("COMMIT")).start()
    writer, before = Writer(hurried, retry=0.05), time.monotonic()
    for number in range(5):
        rows = body_rows(booking_of(number))
        writer.submit(lambda connection, rows=rows: book(connection, rows))
    handed_over = time.monotonic() - before
    assert writer.close() and writer.trouble is None
    assert handed_over < 0.5 and len(list_bodies(database, Filter())) == 5
    for open_one in (database, hurried, other):
        open_one.close()


def test_closing_gives_up_in_time_and_says_so(tmp_path):
    path = tmp_path / "results.sqlite"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cell.results.database.WAIT", 0.1)
        database = open_database(path)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    writer = Writer(database, retry=0.1)
    writer.submit(lambda connection: book(connection, body_rows(booking_of(1))))
    assert not writer.close(timeout=0.5) and "locked" in writer.trouble
    other.close()
    database.close()
