"""Opening on a controller that is wrong, silent or stopped; and the way back after a stop."""

import socket
import struct
import time

import numpy as np
import pytest

from cell.core.errors import DeviceError
from cell.core.kinematics import arm_for
from cell.core.ports import Move, RobotStoppedError
from cell.devices.ur import UrRobot

AWAY = np.array([0.2, 0.1, -0.1, 0.1, 0.1, -0.2])


def move_on(robot, speed=2.0):
    start = np.array(robot.state().joints)
    reached = robot.move_to([Move(tuple(start + AWAY), speed, 6.0)])
    assert reached.joints == pytest.approx(start + AWAY, abs=1e-3)


@pytest.mark.parametrize(("fault", "state"), [
    ("local_mode on", "local_mode"), ("protective_stop", "protective_stop"),
    ("safeguard on", "safeguard_stop"), ("emergency_stop on", "emergency_stop")])
def test_a_stopped_controller_is_not_opened(robot, emulator, truth, fault, state):
    emulator.tell_referee(fault)
    with pytest.raises(RobotStoppedError) as caught:
        robot.open()
    assert caught.value.state == state
    assert truth()["uploads"] == 0


def test_nobody_at_the_address(settings):
    begun = time.monotonic()
    with pytest.raises(DeviceError, match=r"127\.250\.250\.250:30004"):
        UrRobot(settings, "127.250.250.250").open()
    assert time.monotonic() - begun < 5.0


def test_a_controller_that_accepts_and_is_silent(settings):
    listeners = [socket.create_server(("127.250.250.251", port))
                 for port in (30004, 30003, 30001, 29999)]
    begun = time.monotonic()
    with pytest.raises(DeviceError, match="does not speak RTDE"):
        UrRobot(settings, "127.250.250.251").open()
    assert time.monotonic() - begun < 8.0
    for listener in listeners:
        listener.close()


def test_a_controller_that_hangs_is_told_in_time(robot, emulator):
    emulator.tell_referee("freeze on")
    begun = time.monotonic()
    with pytest.raises(DeviceError, match="does not speak RTDE"):
        robot.open()
    assert time.monotonic() - begun < 10.0


def test_registers_that_another_client_holds_are_explained(robot, emulator, truth):
    names = b"input_int_register_0"
    with socket.create_connection((emulator.address, 30004), timeout=5.0) as fieldbus:
        fieldbus.sendall(struct.pack(">HB", 3 + len(names), ord("I")) + names)
        fieldbus.recv(100)
        with pytest.raises(DeviceError, match="fieldbus"):
            robot.open()
    assert truth()["moves_started"] == 0
    robot.open()


def test_a_dashboard_connection_that_broke_is_made_anew(robot, emulator, truth):
    robot.open()
    robot._dashboard._link.shutdown(socket.SHUT_RDWR)
    robot.stop()
    assert truth()["runtime"] == "STOPPED"


def test_another_model_is_named(emulator, settings, truth):
    other = UrRobot(settings.model_copy(update={"model": "ur5e"}), emulator.address)
    with pytest.raises(DeviceError, match="says ur5e, the controller is a UR10"):
        other.open()
    assert truth()["uploads"] == 0


def test_another_robots_serial_is_named(emulator, settings):
    other = UrRobot(settings.model_copy(update={"serial": "20200000001"}), emulator.address)
    with pytest.raises(DeviceError, match="robot 20200000001, this is robot 20235500417"):
        other.open()


def test_a_robot_in_use_is_not_taken_over(robot, emulator, settings, truth):
    robot.open()
    second = UrRobot(settings, emulator.address)
    with pytest.raises(DeviceError, match="a program is running"):
        second.open()
    second.close()
    assert truth()["uploads"] == 1
    move_on(robot)


@pytest.mark.soak
def test_a_program_that_does_not_start_is_told_in_time(robot, emulator):
    emulator.tell_referee("refuse_upload on")
    begun = time.monotonic()
    with pytest.raises(DeviceError, match="could not start"):
        robot.open()
    assert time.monotonic() - begun < 15.0
    emulator.tell_referee("refuse_upload off")
    robot.open()


def test_the_flange_does_not_depend_on_the_tcp(robot, emulator):
    emulator.tell_referee("other_tcp")
    identity = robot.open()
    state = robot.state()
    assert identity.tcp_offset == pytest.approx((0, 0, 100.0, 0, 0.3, 0), abs=1e-9)
    wanted = arm_for("ur10e").forward(state.joints)
    assert wanted.distance(state.base_from_flange)[0] < 1e-6


def test_a_tcp_that_changes_during_the_work_is_noticed(robot, emulator, truth):
    robot.open()
    emulator.tell_referee("other_tcp")
    time.sleep(0.1)
    with pytest.raises(DeviceError, match="TCP was changed"):
        robot.state()
    assert truth()["runtime"] == "STOPPED"


def test_the_identity_is_what_the_controller_says(robot):
    identity = robot.open()
    assert identity.model == "ur10e"
    assert identity.serial == "20235500417"
    assert identity.software.startswith("5.14")
    assert len(identity.kinematics_checksum.split("-")) == 6
    assert identity.payload_kg == pytest.approx(3.2)
    assert len(robot.state().temperatures) == 6


def test_after_a_protective_stop_the_robot_comes_back_in_its_time(robot, emulator, truth):
    robot.open()
    emulator.tell_referee("protective_stop")
    stopped_at = time.monotonic()
    stands = truth()["joints"]
    with pytest.raises(RobotStoppedError):
        move_on(robot)
    state = robot.recover()
    assert time.monotonic() - stopped_at >= 5.0
    assert state.joints == pytest.approx(stands, abs=1e-6)
    move_on(robot)


@pytest.mark.soak
def test_after_an_emergency_stop_power_is_brought_back(robot, emulator):
    robot.open()
    emulator.tell_referee("emergency_stop on")
    with pytest.raises(RobotStoppedError):
        move_on(robot)
    with pytest.raises(RobotStoppedError) as still:
        robot.recover()
    assert still.value.state == "emergency_stop"
    emulator.tell_referee("emergency_stop off")
    robot.recover()
    move_on(robot)


@pytest.mark.parametrize(("fault", "cure", "state"), [
    ("safeguard on", "safeguard off", "safeguard_stop"),
    ("local_mode on", "local_mode off", "local_mode")])
def test_what_only_a_person_can_cure_is_waited_for(robot, emulator, fault, cure, state):
    robot.open()
    emulator.tell_referee(fault)
    for attempt in (lambda: move_on(robot), robot.recover):
        with pytest.raises(RobotStoppedError) as caught:
            attempt()
        assert caught.value.state == state
    emulator.tell_referee(cure)
    robot.recover()
    move_on(robot)


@pytest.mark.parametrize("fault", [
    "cut", *(pytest.param(fault, marks=pytest.mark.soak) for fault in ("pause", "kill_program"))])
def test_after_a_lost_connection_or_program_the_robot_comes_back(robot, emulator, truth, fault):
    robot.open()
    stands = truth()["joints"]
    emulator.tell_referee(fault)
    time.sleep(0.1)
    with pytest.raises(RobotStoppedError):
        move_on(robot)
    assert robot.recover().joints == pytest.approx(stands, abs=0.05)
    move_on(robot)
