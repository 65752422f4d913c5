"""The shift's states and orders, and what they leave in the ledger, over recorded bodies."""

import pytest
from made_cell import made_job, once
from made_line import ABORT, RESET, STOP, When, start

from cell.core.documents.shift import BodyType, MasterCheck, ShiftDocument, Takt
from cell.core.ports import Order, RobotStoppedError
from cell.programs.shift.clock import WatchedClock


def test_bodies_come_are_measured_and_released(made):
    made.cell.deviation = lambda body, hole: 0.9 if (body, hole) == (2, 3) else 0.1
    made.run(start("A"), start("B"), start("C"), STOP)
    assert made.verdicts == [("A", "ok"), ("B", "nok"), ("C", "ok")]
    assert [r.sequence for r in made.line.results] == [1, 2, 3]
    assert [(v["body_id"], v["state"], v["verdict"]) for v in made.visits] == [
        ("A", "released", "in_tolerance"), ("B", "released", "out_of_tolerance"),
        ("C", "released", "in_tolerance")]
    assert [b["body_id"] for b in made.bodies] == ["A", "B", "C"]
    assert made.bodies[1]["out_of_tolerance"] == 1 and made.line.results[1].worst == \
        pytest.approx(0.9)
    assert made.states == ["starting", *["ready", "measuring", "result"] * 3, "ready", "stopped"]
    assert all(refusal == "" for _, refusal in made.line.answers) and made.cell.homes == 3


def test_only_approved_papers_give_production_results(made):
    made.run(start("A"), STOP)
    made.approved = True
    made.run(start("B"), STOP)
    assert [(v["body_id"], v["trial"]) for v in made.visits] == [("A", True), ("B", False)]
    assert [b["trial"] for b in made.bodies] == [True, False]
    assert [r.trial for r in made.line.results] == [True, False]


@pytest.mark.parametrize(("order", "refusal"), [
    (start("A", 7), "unknown_type"), (start(""), "no_body_id"),
    (start("A", body_present=False), "no_body"), (RESET, "nothing_to_do"),
    (ABORT, "nothing_to_do"), (Order("end_bypass"), "nothing_to_do")])
def test_what_cannot_be_is_refused_with_a_code_and_no_verdict(made, order, refusal):
    made.run(When("ready", order), STOP)
    assert made.line.answers[0] == (order, refusal)
    assert made.line.results == [] and made.visits == []


def test_a_refused_start_is_in_the_ledger(made):
    made.run(start("A", 7), STOP)
    assert made.notices == [("refused", "body 'A' of type 7: unknown_type")]


def test_a_result_is_held_and_nothing_comes_in_before_it_is_acknowledged(made):
    made.line.patience = 4
    made.run(start("A"), When("result", start("B")), STOP)
    assert ("B", "result_held") in [(o.body_id, r) for o, r in made.line.answers]
    assert [r.body_id for r in made.line.results] == ["A"]


def test_a_master_is_due_first_and_again_after_every_so_many(made):
    made.change(master=MasterCheck(type=9, job="master.yaml", every=2, limit_mm=0.15))
    made.cell.deviation = lambda body, hole: 0.1
    made.run(start("A"), start("M", 9), start("A"), start("B"), start("C"), start("M", 9),
             start("C"), STOP)
    assert [(v["body_id"], v["kind"]) for v in made.visits] == [
        ("M", "master"), ("A", "body"), ("B", "body"), ("M", "master"), ("C", "body")]
    assert [refusal for _, refusal in made.line.answers].count("master_due") == 2
    assert made.visits[0]["reason"].startswith("master check passed: 0.100 mm")
    assert made.shift.done == 3 and made.states[1] == "master_due"


def test_a_master_out_of_its_limit_stops_production_until_one_passes(made):
    made.change(master=MasterCheck(type=9, job="master.yaml", every=5, limit_mm=0.15))
    made.cell.deviation = lambda body, hole: 0.2 if body == 1 else 0.1
    made.run(start("M", 9), When("master_failed", start("A")), RESET, start("A"), start("M", 9),
             start("A"), STOP)
    assert made.verdicts == [("M", "nok"), ("M", "ok"), ("A", "ok")]
    assert [(f["state"], f["recovered_by"]) for f in made.faults] == [("master_failed", "Meier")]
    assert [r for _, r in made.line.answers] == ["", "not_ready", "", "master_due", "", "", ""]


def test_a_master_with_a_missing_hole_has_not_passed(made):
    made.change(master=MasterCheck(type=9, job="master.yaml"))
    made.cell.deviation = lambda body, hole: "blurred" if hole == 2 else 0.0
    made.run(start("M", 9), RESET, STOP)
    assert made.verdicts == [("M", "incomplete")] and len(made.faults) == 1


def test_a_bypass_lets_bodies_pass_and_is_a_record(made):
    made.change(bypass=made.document.bypass.model_copy(
        update={"reasons": {"3": "sensor window broken"}}))
    made.run(start("A"), Order("bypass", operator="17", reason="3"), start("B"), start("C"),
             Order("end_bypass", operator="Meier"), start("D"), STOP)
    assert made.verdicts == [("A", "ok"), ("B", "incomplete"), ("C", "incomplete"), ("D", "ok")]
    assert [v["kind"] for v in made.visits] == ["body", "bypassed", "bypassed", "body"]
    assert "sensor window broken" in made.visits[1]["reason"]
    bypass = made.ledger.rows(bypasses_table())[0]
    assert (bypass["requested_by"], bypass["reason"], bypass["ended_by"]) \
        == ("17", "sensor window broken", "Meier")
    assert bypass["until"] - bypass["since"] == pytest.approx(3600.0)


def bypasses_table():
    from cell.results.tables import bypasses
    return bypasses


@pytest.mark.parametrize("nameless", [Order("bypass", reason="3"), Order("bypass", operator="17")])
def test_a_bypass_without_who_and_why_is_refused(made, nameless):
    made.run(nameless, start("A"), STOP)
    assert made.line.answers[0] == (nameless, "not_named") and made.verdicts == [("A", "ok")]


def test_a_bypass_outlives_a_restart_but_not_its_time(made):
    made.run(Order("bypass", operator="17", reason="x"), start("A"), STOP)
    made.run(start("B"), STOP)
    assert [v["kind"] for v in made.visits] == ["bypassed", "bypassed"]
    made.clock = WatchedClock(wall=lambda: 4e9)
    made.run(start("C"), STOP)
    assert made.visits[-1]["kind"] == "body"
    assert "longest time" in made.ledger.rows(bypasses_table())[0]["ended_by"]


def test_the_takt_drops_declared_classes_and_never_another(made):
    classes = {1: "minor", 2: "critical", 4: "minor", 5: ""}
    made.cell.jobs = {"demo.yaml": made_job(importance=lambda n: classes.get(n, ""))}
    made.change(takt=Takt(seconds=0.01, hole_s=1.0, reserve_s=0.0))
    made.run(start("A"), STOP)
    assert made.visits[0]["reason"] == "dropped for the takt: H1, H4"
    assert made.bodies[0]["measured"] == 4 and made.verdicts == [("A", "incomplete")]


def test_a_takt_without_droppable_holes_is_missed_rather_than_cut(made):
    import time
    made.change(takt=Takt(seconds=0.05, hole_s=1.0, reserve_s=0.0))
    made.cell.plant = lambda body, hole: time.sleep(0.02)
    made.run(start("A"), STOP)
    assert made.verdicts == [("A", "ok")] and made.notices[0][0] == "takt"


def test_a_critical_class_cannot_be_declared_droppable():
    with pytest.raises(ValueError, match="never dropped"):
        Takt(seconds=60.0, droppable=("minor", "critical"))


def test_a_clock_that_is_set_is_noticed(made):
    jump = [0.0]
    import time
    made.clock = WatchedClock(wall=lambda: time.time() - jump[0])
    made.cell.plant = lambda body, hole: jump.__setitem__(0, 3600.0) if hole == 2 else None
    made.run(start("A"), STOP)
    assert made.notices == [("clock", "the clock was set back by 3600.0 s")]
    made.clock = WatchedClock(wall=lambda: time.time() - 7200.0)
    made.run(STOP)
    assert "less than the last entry" in made.notices[-1][1] or \
        "less than the last entry" in made.notices[0][1]


def test_a_master_is_measured_whole_whatever_the_takt(made):
    made.cell.jobs["master.yaml"] = made_job("master", importance=lambda n: "minor")
    made.change(takt=Takt(seconds=0.01, hole_s=1.0, reserve_s=0.0),
                master=MasterCheck(type=9, job="master.yaml"))
    made.run(start("M", 9), STOP)
    assert made.bodies[0]["measured"] == 6 and made.verdicts == [("M", "ok")]


def test_the_zone_is_clear_only_after_the_arm_has_come_home(made):
    made.cell.plant = once(RobotStoppedError("still", state="emergency_stop"), body=0, hole="start")
    made.run(RESET, start("A"), STOP)
    before = made.boards[:made.states.index("emergency_stop") + 1]
    assert not any(board.clear for board in before) and made.verdicts == [("A", "ok")]
    assert [(f["state"], f["sequence"]) for f in made.faults] == [("emergency_stop", None)]


def test_bodies_are_counted(made):
    made.run(start("A"), start("B"), start("C"), bodies=2)
    assert [v["body_id"] for v in made.visits] == ["A", "B"]


def test_stop_ends_the_shift_after_the_body(made):
    made.run(start("A"), When("measuring", STOP, hole=1), start("B"))
    assert made.verdicts == [("A", "ok")] and made.cell.homes == 1 and made.boards[-1].clear


def test_a_type_may_not_be_named_twice():
    with pytest.raises(ValueError, match="named once"):
        ShiftDocument(name="x", cell="x", bodies=(BodyType(type=1, job="a"),),
                      master=MasterCheck(type=1, job="b"))
