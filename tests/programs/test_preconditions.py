"""Before anything moves: every line of the first screen has a verdict, what residuals cannot show
needs a reason, and the boards are chosen.
"""

import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from made_operator import Scripted

from cell.core.documents.calibration_session import CalibrationPlan
from cell.core.errors import DocumentError
from cell.core.ports import RobotIdentity
from cell.programs.calibration.belief import read_belief
from cell.programs.calibration.opening import PLACES_NEEDED, Opening
from cell.programs.calibration.preconditions import (
    accept_preconditions,
    check_preconditions,
    show_preconditions,
)

ROOT = Path(__file__).parents[2]
DAY = date(2026, 11, 22)
WARM = (33.0, 34.0, 33.5, 31.0, 31.0, 30.0)


@pytest.fixture
def belief():
    return read_belief(ROOT / "calibration", "demo")


@pytest.fixture
def identity(belief):
    robot = belief.hand_eye.robot
    return RobotIdentity(robot.model, robot.serial, "5.14", robot.kinematics_checksum,
                         robot.payload_kg, robot.tcp_offset)


def check(belief, identity, what="all", temperatures=WARM, **board):
    boards = [belief.targets.boards[0].model_copy(update=board)]
    lines = check_preconditions(what, belief, boards, identity, temperatures, DAY)
    return {line.item: line for line in lines}


def test_all_is_met_by_the_demo_cell(belief, identity):
    lines = check(belief, identity)
    assert {line.verdict for line in lines.values()} == {"pass", "asked"}
    assert lines["joints"].verdict == "asked"
    operator = Scripted()
    show_preconditions(tuple(lines.values()), operator)
    assert operator.heard("30 to 34 C") and all(operator.heard(item) for item in lines)
    assert accept_preconditions(tuple(lines.values()), "", operator) == ""


@pytest.mark.parametrize(("change", "item"), [
    ({"tcp_offset": (0.0, 0.0, 120.0, 0.0, 0.0, 0.0)}, "TCP offset"),
    ({"payload_kg": 4.5}, "payload"),
    ({"kinematics_checksum": "00-00"}, "kinematics"),
])
def test_a_difference_from_the_set_needs_a_typed_reason(belief, identity, change, item):
    lines = check(belief, replace(identity, **change))
    assert [one.item for one in lines.values() if one.verdict == "warn"] == [item]
    operator = Scripted({"Why may it": "the new gripper"})
    given = accept_preconditions(tuple(lines.values()), "", operator)
    assert given == "the new gripper" and operator.heard(f"! {item}")
    with pytest.raises(DocumentError, match=f"without a reason.*{item}"):
        accept_preconditions(tuple(lines.values()), "", Scripted())
    assert accept_preconditions(tuple(lines.values()), "in the plan", Scripted()) == "in the plan"


def test_checksums_are_shown_short_and_compared_whole(belief, identity):
    long = "0123456789" * 4
    robot = belief.hand_eye.robot.model_copy(update={"kinematics_checksum": long})
    other = replace(belief, hand_eye=belief.hand_eye.model_copy(update={"robot": robot}))
    lines = [check(other, replace(identity, kinematics_checksum=found))["kinematics"]
             for found in (long, long.replace("90123456789012", "90123456x89012"))]
    assert [one.verdict for one in lines] == ["pass", "warn"]
    assert {one.found for one in lines} == {"01234567...23456789"}


def test_the_light_plane_alone_would_keep_the_hand_eye_of_another_robot(belief, identity):
    lines = check(belief, replace(identity, payload_kg=4.5), what="light-plane")
    assert lines["payload"].verdict == "refuse"
    with pytest.raises(DocumentError, match="calibrate `hand-eye` or `all`"):
        accept_preconditions(tuple(lines.values()), "never mind", Scripted())


@pytest.mark.parametrize("change", [{"model": "ur5e"}, {"serial": "1"}])
def test_another_robot_than_the_cell_names_is_refused(belief, identity, change):
    lines = check(belief, replace(identity, **change))
    assert "refuse" in [line.verdict for line in lines.values()]


@pytest.mark.parametrize(("board", "verdict"), [
    ({"certified_until": "2026-11-22"}, "pass"),
    ({"certified_until": "2026-11-21"}, "warn"),
    ({"certified_until": "next year"}, "warn"),
    ({"certified_until": None}, "warn"),
    ({"certificate": None}, "warn"),
])
def test_a_board_without_a_valid_certificate_needs_a_reason(belief, identity, board, verdict):
    line = check(belief, identity, **board)["board table"]
    assert line.verdict == verdict
    assert verdict == "pass" or "caliper" in line.advice


@pytest.mark.parametrize(("then", "verdict"), [(WARM, "pass"), ((36.0,) * 6, "warn"),
                                               ((), "asked")])
def test_a_cold_arm_is_seen_by_the_temperatures_of_the_last_set(belief, identity, tmp_path, then,
                                                                verdict):
    home = tmp_path / "sets" / belief.set_id
    home.mkdir(parents=True)
    view = {"of": "any version", "temperatures": then}
    (home / "views.jsonl").write_text(json.dumps(view) + "\n")
    lines = check(replace(belief, folder=tmp_path), identity)
    assert lines["joints"].verdict == verdict


def test_the_arms_own_rows_want_boards_in_two_places(belief):
    operator = Scripted({"at all?": "all"})
    first = belief.targets.boards[0]

    def chosen(plan, *boards, what="hand-eye"):
        targets = belief.targets.model_copy(update={"boards": boards})
        opening = Opening(what, plan, replace(belief, targets=targets), None, operator, None)
        return [board.id for board in opening._choose_boards()]

    assert chosen(CalibrationPlan(kinematics=True), first) == ["table"]
    assert operator.said == [PLACES_NEEDED]
    other = first.model_copy(update={"id": "wall"})
    assert chosen(CalibrationPlan(), first, other) == ["table", "wall"]
    assert chosen(CalibrationPlan(board="wall", kinematics=True), first, other) == ["wall", "table"]
    assert chosen(CalibrationPlan(), first, other, what="light-plane") == ["table"]
    operator.answers = {"at all?": "one"}
    assert chosen(CalibrationPlan(), first, other) == ["table"]
