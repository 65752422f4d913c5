"""Booking bodies: idempotent, whole or not at all, the same over SQLite and PostgreSQL."""

from dataclasses import replace

import pytest
from made_bodies import booking_of
from sqlalchemy import func, insert, select, text, update

from cell.core.errors import DocumentError
from cell.results.approvals import approve, approved, withdraw
from cell.results.booking import body_rows, book, hash_texts
from cell.results.database import (
    DatabaseError,
    open_database,
    read_database,
    recreate_results,
)
from cell.results.query import Filter, export_rows, list_bodies, show_body, trend
from cell.results.tables import approvals, axes, bodies, calibrations, features, meta


def _book(database, *bookings):
    for booking in bookings:
        with database.transaction() as connection:
            book(connection, body_rows(booking))


def _count(database, table):
    with database.transaction() as connection:
        return connection.execute(select(func.count()).select_from(table)).scalar_one()


def _counts(database):
    return [_count(database, table) for table in (bodies, features, axes, calibrations)]


def test_a_body_is_booked_with_all_its_numbers(database):
    _book(database, booking_of(1))
    body, rows = show_body(database, "BODY1")
    assert (body["verdict"], body["measured"], body["out_of_tolerance"], body["missing"]) \
        == ("incomplete", 2, 1, 1)
    assert body["worst"] == pytest.approx(0.7) and body["seal"] == f"{1:064x}"
    assert '"residuals": [0.1, 0.2]' in body["alignment"]
    assert [(r["feature"], r["axis"]) for r in rows] == [
        ("H0", "d"), ("H0", "x"), ("H0", "y"), ("H0", "z"), ("H1", "d"), ("H1", "x"), ("H1", "y"),
        ("H1", "z"), ("H2", "d"), ("H2", "x"), ("H2", "y")]
    by_name = {(r["feature"], r["axis"]): r for r in rows}
    assert by_name["H1", "x"]["deviation"] == 0.7 and by_name["H1", "x"]["uncertainty"] == 0.03
    assert by_name["H1", "x"]["verdict"] == "out_of_tolerance"
    assert by_name["H0", "z"]["nominal"] is None and by_name["H0", "z"]["measured"] == 77.7
    missing = by_name["H2", "x"]
    assert (missing["measured"], missing["deviation"], missing["reason"]) \
        == (None, None, "no_stripe")


def test_booking_twice_changes_nothing(database):
    _book(database, booking_of(1), booking_of(2))
    once = list_bodies(database, Filter()), _counts(database)
    _book(database, booking_of(1), booking_of(2), booking_of(1))
    again = list_bodies(database, Filter()), _counts(database)

    def without_key(rows):
        return [{k: v for k, v in row.items() if k != "key"} for row in rows]
    assert without_key(once[0]) == without_key(again[0])
    assert once[1] == again[1] == [2, 6, 22, 1]


def test_a_second_booking_replaces_what_the_first_said(database):
    _book(database, booking_of(1), booking_of(1, deviations=(0.0,)))
    body, rows = show_body(database, "run-000001")
    assert body["verdict"] == "in_tolerance" and {row["feature"] for row in rows} == {"H0"}


def test_a_write_that_breaks_leaves_nothing_behind(database):
    broken = body_rows(booking_of(1))
    broken.axes[-1]["feature"] = None
    with pytest.raises(DatabaseError) as refused, database.transaction() as connection:
        book(connection, broken)
    assert not refused.value.passing and _counts(database) == [0, 0, 0, 0]


def test_a_run_that_died_is_incomplete_and_not_forgotten(database):
    _book(database, booking_of(1, stop=None))
    (body,) = list_bodies(database, Filter())
    assert (body["status"], body["verdict"], body["finished"]) == ("died", "incomplete", None)


def test_filters_narrow_and_the_latest_comes_first(database):
    trial = booking_of(4)
    _book(database, booking_of(1), booking_of(2, deviations=(0.1,)), booking_of(3, job="other"),
          replace(trial, start=replace(trial.start, trial=True)))

    def found(**wanted):
        return [row["body_id"] for row in list_bodies(database, Filter(**wanted))]
    assert found() == ["BODY4", "BODY3", "BODY2", "BODY1"]
    assert found(last=2) == ["BODY4", "BODY3"]
    assert found(verdict="in_tolerance") == ["BODY2"]
    assert found(job="other") == ["BODY3"]
    assert found(production_only=True) == ["BODY3", "BODY2", "BODY1"]
    assert found(since=1.7e9 + 120, until=1.7e9 + 240) == ["BODY3", "BODY2"]
    assert found(body_id="BODY1") == ["BODY1"]
    assert show_body(database, "nobody") is None


def test_a_trend_follows_one_axis_over_time(database):
    _book(database, *(booking_of(n, deviations=(0.01 * n, 0.3)) for n in (3, 1, 2)))
    points = trend(database, "H0", "x", Filter())
    assert [p.body_id for p in points] == ["BODY1", "BODY2", "BODY3"]
    assert [p.deviation for p in points] == pytest.approx([0.01, 0.02, 0.03])
    assert [p.body_id for p in trend(database, "H0", "x", Filter(last=2))] == ["BODY2", "BODY3"]


def test_the_export_has_a_line_for_every_axis_and_for_every_missing_hole(database):
    _book(database, booking_of(2), booking_of(1))
    rows = list(export_rows(database, Filter()))
    assert len(rows) == 22 and [r["body_id"] for r in rows[::11]] == ["BODY1", "BODY2"]
    assert {r["body_verdict"] for r in rows} == {"incomplete"}


def test_another_schema_is_refused_with_what_to_do(url, database):
    with database.transaction() as connection:
        connection.execute(update(meta).values(schema=99))
    with pytest.raises(DocumentError, match="cell results rebuild"):
        open_database(url)


def test_an_older_schema_is_brought_to_this_one_with_its_records(database):
    approve(database, [_approval("a" * 64)])
    _book(database, booking_of(1))
    with database.transaction() as connection:
        connection.execute(update(meta).values(schema=0))
        connection.execute(text("ALTER TABLE approvals DROP COLUMN withdrawn_at"))
        connection.execute(text("ALTER TABLE bodies ADD COLUMN forgotten INTEGER"))
        recreate_results(connection)
    _book(database, booking_of(1))
    assert approved(database, ["a" * 64]) and _counts(database)[0] == 1
    with database.transaction() as connection:
        assert connection.execute(select(meta.c.schema)).scalar_one() == 1


def test_a_newer_schema_is_left_alone(database):
    approve(database, [_approval("a" * 64)])
    with database.transaction() as connection:
        connection.execute(update(meta).values(schema=99))
    with pytest.raises(DocumentError, match="newer"), database.transaction() as connection:
        recreate_results(connection)
    assert _count(database, approvals) == 1


def test_recreating_keeps_the_records_that_no_recording_holds(database):
    _book(database, booking_of(1))
    approve(database, [_approval("a" * 64)])
    with database.transaction() as connection:
        recreate_results(connection)
    assert _counts(database)[:3] == [0, 0, 0] and approved(database, ["a" * 64])
    _book(database, booking_of(1))
    assert _counts(database) == [1, 3, 11, 1]


def _approval(digest):
    return {"hash": digest, "kind": "job", "name": "demo", "approved_by": "A. Meier",
            "approved_at": 1.7e9, "note": ""}


def test_papers_are_approved_together_and_can_be_withdrawn(database):
    approve(database, [_approval("a" * 64), _approval("b" * 64)])
    assert approved(database, ["a" * 64, "b" * 64])
    assert not approved(database, ["a" * 64, "c" * 64])
    assert withdraw(database, ["b" * 64], at=1.8e9) == 1
    assert not approved(database, ["a" * 64, "b" * 64])
    with database.transaction() as connection:
        assert set(connection.scalars(select(approvals.c.withdrawn_at))) == {None, 1.8e9}
    approve(database, [_approval("b" * 64)])
    assert approved(database, ["a" * 64, "b" * 64])


def test_texts_hash_by_name_and_content_in_any_order():
    assert hash_texts({"a": "1", "b": "2"}) == hash_texts({"b": "2", "a": "1"})
    assert len({hash_texts(t) for t in ({"a": "12"}, {"a": "1", "b": "2"}, {"b": "12"},
                                        {"a1": "2"}, {})}) == 5


@pytest.mark.parametrize(("where", "words"), [
    ("nonsense", "database URL"), ("oracle7://host/x", "database URL")])
def test_a_wrong_url_is_refused(where, words):
    with pytest.raises(DocumentError, match=words):
        open_database(where)


def test_a_server_that_is_not_there_is_an_error_that_may_pass():
    with pytest.raises(DatabaseError) as error:
        open_database("postgresql+psycopg://nobody:secret@127.0.0.1:9/none")
    assert error.value.passing and "secret" not in str(error.value)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(DatabaseError, match="unable to open"):
        open_database(tmp_path / "absent" / "results.sqlite")


def test_integrity_is_the_databases_own(database):
    with pytest.raises(DatabaseError), database.transaction() as connection:
        connection.execute(insert(features), {"body": 4711, "feature": "H0", "position": 0,
                                              "verdict": "in_tolerance"})


@pytest.mark.parametrize("changing", [False, True])
def test_a_database_is_read_without_touching_it(tmp_path, changing):
    """As an auditor does on a copy that cannot be written; a shift may be running beside it."""
    file = tmp_path / "results.sqlite"
    writing = open_database(file)
    _book(writing, booking_of(1))
    if not changing:
        writing.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    reading = read_database(file)
    assert [body["body_id"] for body in list_bodies(reading, Filter())] == ["BODY1"]
    with pytest.raises(DatabaseError, match="readonly"):
        _book(reading, booking_of(2))
    reading.close()
    if not changing:
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    writing.close()


def test_a_database_that_is_not_there_is_not_made_for_reading(tmp_path):
    with pytest.raises(DocumentError, match="there is no results database here"):
        read_database(tmp_path / "results.sqlite")
    (tmp_path / "results.sqlite").touch()
    with pytest.raises(DocumentError, match="has schema None"):
        read_database(tmp_path / "results.sqlite")
