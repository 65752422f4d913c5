"""Every fault, caused in the middle of a move with the laser on, against the real client.

Promised each time: no hang beyond a deadline, no move reported done that was not, the arm at rest,
the laser dark, nothing that goes on by itself afterwards, and the reason told.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from cell.core.errors import DeviceError
from cell.core.ports import Move, RobotStoppedError
from cell.devices.ur import UrLights, UrRobot

FAR = np.array([0.9, 0.25, -0.3, 0.2, 0.1, -0.5])
LASER = 1 << 5

STOPS = [("protective_stop", "protective_stop"), ("safeguard on", "safeguard_stop"),
         ("emergency_stop on", "emergency_stop"), ("local_mode on", "local_mode"),
         ("pause", "paused"), ("kill_program", "lost")]
BREAKS = ["cut", "stall on", *(pytest.param(fault, marks=pytest.mark.soak)
                               for fault in ("freeze_stream on", "garbage", "half_package"))]


def interrupt_a_move(robot, lights, cause, goal_from_start=FAR):
    """Cause a fault 0.25 s into a move of more than a second; return error, seconds and goal."""
    robot.open()
    lights.set("laser")
    goal = np.array(robot.state().joints) + goal_from_start
    timer = threading.Timer(0.25, cause)
    timer.start()
    begun = time.monotonic()
    with pytest.raises(DeviceError) as caught:
        robot.move_to([Move(tuple(goal), 0.25, 1.0)])
    timer.join()
    return caught.value, time.monotonic() - begun, goal


def check_safe(truth, goal):
    """The arm rests short of its goal, the laser is dark, and both stay so."""
    deadline = time.monotonic() + 2.0
    while max(map(abs, truth()["joint_speeds"])) > 1e-6:
        assert time.monotonic() < deadline, "the arm still moves"
    stands = truth()
    assert not stands["outputs"] & LASER
    assert np.abs(np.subtract(stands["joints"], goal)).max() > 0.1
    time.sleep(0.4)
    assert truth()["joints"] == pytest.approx(stands["joints"], abs=1e-9)


@pytest.mark.parametrize(("fault", "state"), STOPS)
def test_a_stop_is_told_by_its_name(robot, lights, emulator, truth, fault, state):
    error, seconds, goal = interrupt_a_move(robot, lights, lambda: emulator.tell_referee(fault))
    assert isinstance(error, RobotStoppedError)
    assert error.state == state
    assert seconds < 4.0
    check_safe(truth, goal)
    with pytest.raises(DeviceError):
        robot.move_to([Move(tuple(goal), 0.5, 1.0)])


@pytest.mark.parametrize("fault", BREAKS)
def test_a_broken_connection_is_a_lost_robot_that_stands(robot, lights, emulator, truth, fault):
    error, seconds, goal = interrupt_a_move(robot, lights, lambda: emulator.tell_referee(fault))
    assert isinstance(error, RobotStoppedError)
    assert error.state == "lost"
    assert seconds < 5.0
    check_safe(truth, goal)
    assert truth()["uploads"] == 1, "the client began to reconnect"


def test_a_pulled_cable_leaves_the_stop_to_the_robots_own_watchdog(robot, lights, emulator, truth):
    error, seconds, goal = interrupt_a_move(robot, lights,
                                            lambda: emulator.tell_referee("freeze on"))
    assert isinstance(error, RobotStoppedError)
    assert error.state == "lost"
    assert seconds < 12.0
    check_safe(truth, goal)


def test_a_controller_that_dies_is_noticed_at_once(mortal_emulator, settings):
    robot = UrRobot(settings, mortal_emulator.address, 3.0)
    error, seconds, _ = interrupt_a_move(robot, UrLights(robot, settings),
                                         lambda: os.kill(mortal_emulator.pid, signal.SIGKILL))
    robot.close()
    assert isinstance(error, RobotStoppedError)
    assert error.state == "lost"
    assert seconds < 5.0


def test_a_client_process_that_is_killed_is_noticed_at_once(robot, lights, truth):
    error, seconds, goal = interrupt_a_move(
        robot, lights, lambda: os.kill(robot.client_pid, signal.SIGKILL))
    assert isinstance(error, RobotStoppedError)
    assert error.state == "lost"
    assert seconds < 3.0
    check_safe(truth, goal)


@pytest.mark.soak
def test_a_client_process_that_hangs_is_killed_at_the_deadline(robot, lights, truth):
    error, seconds, goal = interrupt_a_move(
        robot, lights, lambda: os.kill(robot.client_pid, signal.SIGSTOP))
    assert isinstance(error, RobotStoppedError)
    assert error.state == "lost"
    assert seconds < 15.0
    check_safe(truth, goal)


def test_a_safeguard_that_closes_again_does_not_finish_the_old_move(robot, lights, emulator, truth):
    _, _, goal = interrupt_a_move(robot, lights, lambda: emulator.tell_referee("safeguard on"))
    emulator.tell_referee("safeguard off")
    check_safe(truth, goal)


@pytest.mark.parametrize("fault", [
    "cut", "kill_program", pytest.param("freeze_stream on", marks=pytest.mark.soak),
    pytest.param("stall on", marks=pytest.mark.soak)])
def test_a_fault_at_rest_is_found_by_the_next_request(robot, lights, emulator, truth, fault):
    robot.open()
    lights.set("laser")
    stands = np.array(robot.state().joints)
    emulator.tell_referee(fault)
    time.sleep(0.1)
    begun = time.monotonic()
    with pytest.raises(RobotStoppedError) as caught:
        robot.move_to([Move(tuple(stands + FAR), 0.5, 1.0)])
    assert caught.value.state == "lost"
    assert time.monotonic() - begun < 4.0
    assert truth()["joints"] == pytest.approx(stands.tolist(), abs=0.05)
    lights.off()
    assert not truth()["outputs"] & LASER


@pytest.mark.parametrize("fault", ["freeze_stream on", "stall on"])
def test_a_state_is_never_stale(robot, emulator, fault):
    robot.open()
    emulator.tell_referee(fault)
    begun = time.monotonic()
    with pytest.raises(RobotStoppedError):
        robot.state()
    assert time.monotonic() - begun < 4.0


def test_lights_off_never_raises_even_when_the_controller_is_gone(mortal_emulator, settings):
    robot = UrRobot(settings, mortal_emulator.address, 3.0)
    lights = UrLights(robot, settings)
    robot.open()
    lights.set("laser")
    mortal_emulator.stop()
    begun = time.monotonic()
    lights.off()
    robot.stop()
    robot.close()
    assert time.monotonic() - begun < 10.0


APPLICATION = """
import sys, time
from cell.core.documents.station import RobotSettings
from cell.core.ports import Move
from cell.devices.ur import UrLights, UrRobot
settings = RobotSettings(driver="ur", model="ur10e", digital_output_laser=5)
robot = UrRobot(settings, sys.argv[1])
robot.open()
lights = UrLights(robot, settings)
lights.set("laser")
start = robot.state().joints
print("moving", robot.client_pid, flush=True)
try:
    robot.move_to([Move(tuple(q + 1.0 for q in start), 0.3, 1.0)])
except KeyboardInterrupt:
    lights.off()
    robot.stop()
    robot.close()
    print("safe", flush=True)
"""


@pytest.fixture
def application(emulator):
    running = subprocess.Popen([sys.executable, "-c", APPLICATION, emulator.address], text=True,
                               stdout=subprocess.PIPE, start_new_session=True)
    yield running
    running.kill()
    running.communicate()


def test_kill_9_in_mid_move_ends_the_program_and_the_laser(application, truth):
    worker = int(application.stdout.readline().split()[1])
    time.sleep(0.3)
    moving = truth()
    assert max(map(abs, moving["joint_speeds"])) > 0.1
    assert moving["outputs"] & LASER
    application.kill()
    killed = time.monotonic()
    while truth()["outputs"] & LASER or max(map(abs, truth()["joint_speeds"])) > 1e-6:
        assert time.monotonic() - killed < 2.0
        time.sleep(0.01)
    assert time.monotonic() - killed < 1.0
    assert truth()["runtime"] == "STOPPED"
    deadline = time.monotonic() + 2.0
    while Path(f"/proc/{worker}").exists():
        assert time.monotonic() < deadline, "the client's process outlived the application"
        time.sleep(0.02)


def test_ctrl_c_in_mid_move_ends_with_the_arm_at_rest_and_the_laser_dark(application, truth):
    application.stdout.readline()
    time.sleep(0.3)
    application.send_signal(signal.SIGINT)
    answer, _ = application.communicate(timeout=15)
    assert answer == "safe\n"
    assert not truth()["outputs"] & LASER
    assert max(map(abs, truth()["joint_speeds"])) < 1e-6
