"""How fast 10,000 bodies are booked and asked about, over both databases."""

import time

import numpy as np
import pytest
from made_bodies import booking_of
from results_databases import url

from cell.results.booking import body_rows, book
from cell.results.database import open_database
from cell.results.query import Filter, list_bodies, trend

BODIES, HOLES = 10_000, 24
__all__ = ["url"]



@pytest.mark.bench
@pytest.mark.timeout(1800)
def test_a_month_of_bodies(url, capsys):
    """10,000 bodies of 24 holes: written in minutes, a trend over all of them below 100 ms."""
    database, chance = open_database(url), np.random.default_rng(1)
    before = time.perf_counter()
    for number in range(BODIES):
        rows = body_rows(booking_of(number, deviations=tuple(chance.normal(0, 0.2, HOLES))))
        with database.transaction() as connection:
            book(connection, rows)
    written = time.perf_counter() - before
    times = [_timed(lambda: trend(database, "H7", "x", Filter(production_only=True)))
             for _ in range(5)]
    listed = _timed(lambda: list_bodies(database, Filter(last=100)))
    found = trend(database, "H7", "x", Filter())
    database.close()
    with capsys.disabled():
        print(f"\n{url.split(':')[0]}: {BODIES} bodies, {BODIES * HOLES} features, {written:.0f} s"
              f" ({1000 * written / BODIES:.1f} ms a body); trend of {len(found)} points "
              f"{1000 * np.median(times):.0f} ms; last 100 bodies {1000 * listed:.0f} ms")
    assert len(found) == BODIES and [p.started for p in found] == sorted(p.started for p in found)


def _timed(ask):
    before = time.perf_counter()
    ask()
    return time.perf_counter() - before
