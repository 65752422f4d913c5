"""The controller's own rules, without sockets: outputs, stops, resuming, power."""

import numpy as np
import pytest

from cell.sim.controller.controller import Controller, RobotMode, Runtime, Safety
from cell.sim.controller.dashboard import TOO_EARLY, Dashboard
from cell.sim.controller.motion import JointPath
from cell.sim.controller.program import ControlProgram

AWAY = np.array([0.5, 0.3, -0.2, 0.1, 0.2, -0.4])


@pytest.fixture
def controller():
    made = Controller("ur10e")
    made.play()
    return made


def set_off(controller, speed=0.5):
    goal = controller.joints + AWAY
    controller.go(lambda joints: JointPath(controller.arm, joints, goal, speed, 2.0))
    run(controller, 0.3)
    assert np.abs(controller.joint_speeds).max() > 0.1
    return goal


def run(controller, seconds):
    for _ in range(round(seconds * 125)):
        controller.advance(controller.wall + 0.008)


def test_a_move_ends_at_its_goal_at_rest(controller):
    goal = set_off(controller)
    run(controller, 2.0)
    assert controller.joints == pytest.approx(goal)
    assert not controller.moving


@pytest.mark.parametrize("end", [Controller.end_program, Controller.pause,
                                 Controller.protective_stop, lambda c: c.safeguard(True),
                                 lambda c: c.emergency_stop(True)])
def test_whatever_stops_the_program_lets_the_outputs_fall_and_the_arm_brake(controller, end):
    controller.set_outputs(0b11, 0b10)
    goal = set_off(controller)
    end(controller)
    assert controller.outputs == 0
    controller.set_outputs(0b11, 0b10)
    assert controller.outputs == 0, "an output rose while no program ran"
    run(controller, 0.5)
    assert not controller.moving
    assert np.abs(controller.joints - goal).max() > 0.1


def test_a_paused_move_is_finished_when_the_safeguard_closes(controller):
    goal = set_off(controller)
    controller.safeguard(True)
    run(controller, 1.0)
    controller.safeguard(False)
    run(controller, 2.0)
    assert controller.joints == pytest.approx(goal)


def test_a_program_that_was_ended_finishes_nothing(controller):
    set_off(controller)
    controller.protective_stop()
    controller.end_program()
    run(controller, 5.1)
    stands = controller.joints
    assert controller.unlock()
    controller.play()
    run(controller, 1.0)
    assert controller.joints == pytest.approx(stands)


def test_a_protective_stop_is_not_unlocked_within_five_seconds(controller):
    dashboard = Dashboard(controller)
    controller.protective_stop()
    run(controller, 4.9)
    assert dashboard.answer("unlock protective stop") == TOO_EARLY
    run(controller, 0.2)
    assert dashboard.answer("unlock protective stop") == "Protective stop releasing"
    assert dashboard.answer("safetymode") == "Safetymode: NORMAL"


def test_after_an_emergency_stop_power_comes_back_step_by_step(controller):
    dashboard = Dashboard(controller)
    controller.emergency_stop(True)
    dashboard.answer("restart safety")
    assert controller.safety is Safety.EMERGENCY_STOP, "the button is still pressed"
    controller.emergency_stop(False)
    dashboard.answer("power on")
    run(controller, 0.5)
    assert controller.robot_mode is RobotMode.POWER_OFF, "powered before safety was restarted"
    for order, mode in (("restart safety", RobotMode.POWER_OFF), ("power on", RobotMode.IDLE),
                        ("brake release", RobotMode.RUNNING)):
        dashboard.answer(order)
        run(controller, 0.5)
        assert controller.robot_mode is mode


def test_in_local_mode_the_dashboard_starts_nothing(controller):
    controller.pause()
    controller.remote_control = False
    dashboard = Dashboard(controller)
    assert dashboard.answer("is in remote control") == "false"
    assert dashboard.answer("play").startswith("Failed")
    assert controller.runtime is Runtime.PAUSED


def test_time_runs_faster_by_the_factor():
    fast = Controller("ur10e", speed=10.0)
    fast.play()
    goal = fast.joints + AWAY
    fast.go(lambda joints: JointPath(fast.arm, joints, goal, 0.5, 2.0))
    run(fast, 0.2)
    assert fast.joints == pytest.approx(goal)
    assert fast.time == pytest.approx(2.0)


def test_a_new_move_brakes_the_old_one_first(controller):
    set_off(controller)
    goal = controller.joints - AWAY
    controller.go(lambda joints: JointPath(controller.arm, joints, goal, 0.5, 2.0))
    before, speeds = controller.joints, []
    for _ in range(400):
        controller.advance(controller.wall + 0.008)
        speeds.append((controller.joints - before) / 0.008)
        before = controller.joints
    jumps = np.abs(np.diff(speeds, axis=0)).max() / 0.008
    assert jumps < 16.0, "the arm's speed jumped"
    assert controller.joints == pytest.approx(goal)


def test_an_unknown_command_ends_the_program_instead_of_being_answered(controller):
    registers = {"input_int_register_0": 0}
    program = ControlProgram(controller, registers)
    program.step()
    assert registers["output_int_register_0"] == 1
    registers["input_int_register_0"] = 9
    program.step()
    assert controller.runtime is Runtime.STOPPED
    assert "command 9" in controller.popup


@pytest.mark.parametrize("graver", [Controller.protective_stop, lambda c: c.emergency_stop(True)])
def test_a_gate_that_closes_releases_no_graver_stop(controller, graver):
    graver(controller)
    stopped = controller.safety
    controller.safeguard(True)
    controller.safeguard(False)
    assert controller.safety is stopped
