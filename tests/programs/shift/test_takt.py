"""Which holes the takt guard drops, second by second."""

from made_cell import made_hole

from cell.core.documents.shift import Takt
from cell.programs.shift.takt import TaktGuard

CLASSES = ["critical", "minor", "major", "minor", "", "major"]
HOLES = [made_hole(number, importance) for number, importance in enumerate(CLASSES)]


def _dropped(seconds, at=0.0, holes=HOLES, **takt):
    guard = TaktGuard(Takt(seconds=seconds, droppable=("minor", "major"), hole_s=2.0,
                           reserve_s=1.0, **takt))
    guard.begin(100.0)
    return sorted(guard.dropped(holes, 100.0 + at))


def test_nothing_is_dropped_while_all_fits():
    assert _dropped(13.0) == [] and _dropped(13.0, at=2.0, holes=HOLES[1:]) == []


def test_the_first_class_goes_first_and_its_last_hole_before_its_first():
    assert _dropped(12.9) == ["H3"]
    assert _dropped(10.0) == ["H1", "H3"]
    assert _dropped(8.0) == ["H1", "H3", "H5"]


def test_what_is_not_declared_stays_however_late_it_is():
    assert _dropped(1.5, at=500.0) == ["H1", "H2", "H3", "H5"]


def test_the_guard_learns_what_a_hole_takes():
    guard = TaktGuard(Takt(seconds=13.0, hole_s=2.0, reserve_s=1.0))
    guard.begin(0.0)
    for _ in range(60):
        guard.learn(4.0)
    assert 3.99 < guard.estimate(1) <= 4.0
    assert guard.dropped(HOLES, 0.0) == {"H1", "H3"}
    assert guard.seconds_left(5.0) == 7.0
