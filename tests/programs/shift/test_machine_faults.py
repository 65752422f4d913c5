"""What goes wrong in a shift is a named state; nothing is lost, and a restart answers it first."""

import errno

import pytest
from made_cell import made_job, once
from made_line import ABORT, RESET, STOP, When, start

from cell.core.documents.shift import FaultRules
from cell.core.errors import DeviceError, RecordingError
from cell.core.ports import Order, RobotStoppedError

STOPS = [(RobotStoppedError("stopped", state=state), state)
         for state in ("protective_stop", "safeguard_stop", "emergency_stop")]
LOST = [(RobotStoppedError("gone", state="lost"), "robot_lost"),
        (DeviceError("no image", device="camera"), "camera_lost"),
        (DeviceError("not on", device="lights"), "lights_lost")]


@pytest.mark.parametrize(("error", "state"), STOPS + LOST)
def test_a_fault_is_a_named_state_and_the_body_goes_on_where_it_stopped(made, error, state):
    made.cell.plant = once(error, body=1, hole=3)
    made.run(start("A"), When(state, start("B")), RESET, STOP)
    assert (start("B"), "not_ready") in made.line.answers
    assert state in made.states and made.verdicts == [("A", "ok")]
    (fault,) = made.faults
    assert (fault["state"], fault["recovered_by"], fault["sequence"]) == (state, "Meier", 1)
    shown = next(board for board in made.boards if board.state == state)
    assert shown.fault == state and shown.instruction and shown.busy and not shown.clear
    assert made.cell.safe >= 2 and made.cell.recovered == 1
    assert made.bodies[0]["measured"] == 6


def test_a_body_that_has_moved_is_given_up_and_incomplete(made):
    made.cell.plant = once(RobotStoppedError("bump", state="protective_stop"), body=1, hole=3)
    made.run(start("A"), ABORT, RESET, start("B"), STOP)
    assert made.verdicts == [("A", "incomplete"), ("B", "ok")]
    assert (made.bodies[0]["status"], made.bodies[0]["measured"], made.bodies[0]["missing"]) \
        == ("fault", 3, 3)


def test_a_cause_that_is_still_there_is_not_reset(made):
    made.cell.plant = once(DeviceError("no image", device="camera"), body=1, hole=0)
    made.cell.unrecoverable = [DeviceError("still no image", device="camera")]
    made.run(start("A"), RESET, RESET, STOP)
    assert [r for o, r in made.line.answers if o == RESET] == ["not_ready", ""]
    assert any("still no image" in board.detail for board in made.boards)
    assert made.verdicts == [("A", "ok")]


def test_a_fault_on_the_way_home_keeps_the_verdict_and_the_zone(made):
    made.cell.plant = once(RobotStoppedError("guard", state="safeguard_stop"), body=1, hole="home")
    made.run(start("A"), RESET, STOP)
    assert made.verdicts == [("A", "ok")] and made.cell.homes == 1
    assert not any(board.clear for board in made.boards if board.state == "safeguard_stop")
    assert made.boards[-1].clear


def test_holes_refused_in_a_row_are_a_fault_of_the_cell(made):
    made.change(faults=FaultRules(refused_in_a_row=3))
    made.cell.deviation = lambda body, hole: "not_round" if body == 1 and hole > 1 else 0.0
    made.run(start("A"), RESET, start("B"), STOP)
    (fault,) = made.faults
    assert fault["state"] == "holes_refused" and "H4 (not_round)" in fault["detail"]
    assert made.verdicts == [("A", "incomplete"), ("B", "ok")]
    assert made.bodies[0]["missing"] == 4


def test_refusals_at_the_last_holes_and_a_dark_laser_are_seen(made):
    made.change(faults=FaultRules(refused_in_a_row=2))
    made.cell.deviation = lambda body, hole: "no_laser" if hole >= 4 else 0.0
    made.run(start("A"), RESET, STOP)
    assert [f["state"] for f in made.faults] == ["laser_dark"]


def test_scattered_refusals_are_no_fault(made):
    made.change(faults=FaultRules(refused_in_a_row=2))
    made.cell.deviation = lambda body, hole: "blurred" if hole % 2 else 0.0
    made.run(start("A"), STOP)
    assert made.faults == [] and made.verdicts == [("A", "incomplete")]


@pytest.mark.parametrize("matters", [True, False])
def test_a_missing_datum_is_a_fault_where_the_shift_says_so(made, matters):
    made.change(faults=FaultRules(datum_missing=matters))
    made.cell.jobs = {"demo.yaml": made_job(datums=["H1"])}
    made.cell.deviation = lambda body, hole: "half_occluded" if hole == 1 else 0.0
    made.run(start("A"), *[RESET] * matters, STOP)
    assert [f["state"] for f in made.faults] == (["datum_missing"] if matters else [])
    assert made.verdicts == [("A", "incomplete")]


def test_the_line_aborts_a_body(made):
    left = Order("abort", reason="the body left the station")
    made.run(start("A"), When("measuring", left, hole=2), start("B"), STOP)
    assert made.verdicts == [("A", "incomplete"), ("B", "ok")]
    assert (made.bodies[0]["status"], made.bodies[0]["measured"]) == ("aborted", 2)
    assert made.visits[0]["reason"] == "the body left the station"


def test_a_full_disk_while_recording_leaves_the_body_incomplete_and_the_cell_standing(made):
    full = RecordingError("no space left")
    full.__cause__ = OSError(errno.ENOSPC, "No space left on device")
    made.cell.plant = once(full, body=1, hole=2)
    made.run(start("A"), RESET, start("B"), STOP)
    assert [f["state"] for f in made.faults] == ["disk_full"]
    assert made.verdicts == [("A", "incomplete"), ("B", "ok")]


def test_a_recording_that_cannot_be_begun_waits_for_the_person(made):
    begin, failures = made.cell.begin, [RecordingError("no room")]

    def begin_later(*args, **kwargs):
        if failures:
            raise failures.pop()
        return begin(*args, **kwargs)
    made.cell.begin = begin_later
    made.run(start("A"), RESET, STOP)
    assert [f["state"] for f in made.faults] == ["recording_failed"]
    assert made.verdicts == [("A", "ok")]


class KilledError(BaseException):
    """Stands for SIGKILL: nothing of the program runs after it."""


@pytest.mark.parametrize(("moment", "state"), [(3, "measuring"), ("home", "judged")])
def test_what_a_killed_shift_left_is_answered_first(made, moment, state):
    made.cell.plant = once(KilledError(), body=1, hole=moment)
    made.cell.make_safe = lambda: None
    with pytest.raises(KilledError):
        made.run(start("A"))
    assert [v["state"] for v in made.visits] == [state]
    told = len(made.line.results)
    made.cell.plant = lambda body, hole: None
    made.run(start("B"), STOP)
    assert [r.body_id for r in made.line.results[told:]] == ["A", "B"]
    assert made.line.results[told].sequence == 1
    assert made.line.results[told].verdict == ("incomplete" if state == "measuring" else "ok")
    assert [v["state"] for v in made.visits] == ["released", "released"]


def test_a_ledger_that_fails_is_a_state_and_is_read_again(made):
    from cell.results.database import DatabaseError
    put, failures = made.ledger.database.transaction, [DatabaseError("disk is full", passing=True)]

    def transaction():
        if failures and made.line.statuses[-1].state == "measuring":
            raise failures.pop()
        return put()
    made.ledger.database.transaction = transaction
    made.run(start("A"), RESET, start("B"), STOP)
    assert "results_lost" in made.states
    assert [v["state"] for v in made.visits] == ["released", "released"]
    assert made.verdicts == [("A", "incomplete"), ("B", "ok")]
