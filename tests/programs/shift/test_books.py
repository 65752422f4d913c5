"""The plant's database beside the cell's own: the same rows, and no body waits for it."""

import time

from results_databases import url

from cell.core.ports import Order, RobotStoppedError
from cell.results.database import open_database
from cell.results.ledger import Ledger
from cell.results.query import Filter, list_bodies
from cell.results.tables import faults, notices, visits

__all__ = ["url"]


def _without_key(rows):
    return [{**row, "key": 0} for row in rows]


def test_the_plant_gets_every_row_that_the_cell_has(made, url, tmp_path):
    made.plant = url if "postgres" in url else f"sqlite:///{tmp_path / 'plant.sqlite'}"
    stops = [RobotStoppedError("bump", state="protective_stop")]

    def plant(body, hole):
        if hole == 3 and stops:
            raise stops.pop()
    made.cell.plant = plant
    made.run(Order("start", "A", 1), Order("reset", operator="Meier"), Order("start", "B", 7),
             Order("start", "C", 1), Order("stop"))
    assert made.settled
    plant_database = open_database(made.plant)
    try:
        assert _without_key(list_bodies(plant_database, Filter())) \
            == _without_key(list_bodies(made.database, Filter()))
        there = Ledger(plant_database, "recorded", "early")
        for table in (visits, faults, notices):
            assert there.rows(table) == made.ledger.rows(table)
    finally:
        plant_database.close()


def test_a_plant_that_is_away_delays_nobody_and_is_told(made):
    made.plant, made.patience = "postgresql+psycopg://nobody@127.0.0.1:9/none", 0.3
    began = time.monotonic()
    made.run(*(Order("start", f"B{n}", 1) for n in range(5)), Order("stop"))
    assert [v["state"] for v in made.visits] == ["released"] * 5
    assert len(made.bodies) == 5 and not made.settled
    assert any("127.0.0.1:9" in board.trouble for board in made.boards) \
        or time.monotonic() - began < 5.0
