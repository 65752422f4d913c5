"""The way of the arm through a session: out of the place where it stands, into the next one."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from made_operator import Scripted

from cell.core.documents.base import as_rows
from cell.core.documents.calibration_session import (
    CalibrationPlan,
    PlacedBoard,
    SessionHeader,
    Target,
    ViewRecord,
)
from cell.core.geometry import Transform
from cell.programs.calibration import gathering
from cell.programs.calibration.belief import read_belief
from cell.programs.calibration.gathering import Gathering
from cell.programs.calibration.session import Session

ROOT = Path(__file__).parents[2]
STARTS = [(0.1,) * 6, (0.2,) * 6]


@pytest.fixture
def belief():
    return read_belief(ROOT / "calibration", "demo")


@pytest.fixture
def session(tmp_path, belief):
    """A session with boards in two places: two views of each, and one of the sphere."""
    boards = tuple(PlacedBoard(board=belief.board(None), start=start,
                               base_from_board=as_rows(Transform.identity())) for start in STARTS)
    targets = tuple(Target(purpose=purpose, joints=(float(number),) * 6, place=place)
                    for number, (purpose, place) in enumerate(
                        [("fit", 0), ("fit", 0), ("fit", 1), ("fit", 1), ("sphere", 0)], start=1))
    return Session.begin(tmp_path / "session", SessionHeader(
        cell="demo", what="hand-eye", begun="2026-11-22T12:00:00Z", base_set=belief.set_id,
        robot=belief.hand_eye.robot, sensor_serial=None, boards=boards,
        plan=CalibrationPlan(), targets=targets))


def have(session, *numbers, status="ok"):
    here = as_rows(Transform.identity())
    for number in numbers:
        target = session.header.numbered[number]
        session.append(ViewRecord(
            number=number, purpose=target.purpose, place=target.place, joints=target.joints,
            base_from_flange=here, base_from_flange_after=here, time=0.0, ring="", stripe="",
            status=status))


@pytest.fixture
def ways(session, belief, monkeypatch):
    """Drive to a view: by which start views the arm leaves and arrives, if it must."""
    asked = []

    def free_path(_belief, _here, there, leave, home, arrive):
        asked.append((STARTS.index(leave), STARTS.index(arrive)))
        assert home == belief.home
        return [there]

    monkeypatch.setattr(gathering, "free_path", free_path)
    robot = SimpleNamespace(state=lambda: SimpleNamespace(joints=(0.0,) * 6),
                            move_to=lambda moves: None)
    station = SimpleNamespace(robot=robot, document=belief.station)

    def drive(*numbers):
        asked.clear()
        views = Gathering(session, belief, station, Scripted(), None)
        for number in numbers:
            views._go(session.header.numbered[number])
        return asked[:]

    return drive


def test_the_opening_leaves_the_arm_at_the_last_board_that_it_looked_at(ways):
    assert ways(1, 2, 3, 5) == [(1, 0), (0, 0), (0, 1), (1, 0)]


@pytest.mark.parametrize(("there", "ways_out"), [
    ([1], [(0, 1), (1, 0)]), ([1, 2, 3], [(1, 1), (1, 0)]), ([1, 2, 3, 4], [(1, 1), (1, 0)])])
def test_a_resumed_session_leaves_the_board_of_the_view_that_it_began_with(session, ways, there,
                                                                           ways_out):
    have(session, *there)
    assert ways(4, 5) == ways_out


def test_a_view_that_is_not_used_is_not_begun_with(session, ways):
    have(session, 1, 2)
    have(session, 3, status="skipped by the operator")
    assert ways(4) == [(0, 1)]
