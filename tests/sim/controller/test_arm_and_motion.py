"""The emulated arm against the application's kinematics (two implementations), and its motion."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cell.core.kinematics import arm_for
from cell.sim.controller.arm import BUILDS, EmulatedArm, matrix_of, pose_of
from cell.sim.controller.motion import Halt, JointPath, LinePath, Trapezoid, UnreachableError

START = np.radians([10.0, -80.0, 90.0, -95.0, -85.0, 12.0])
TURN = [2.0, 0.5, -0.3, 0.1, 0.0, 1.0]
angles = st.lists(st.floats(-6.0, 6.0), min_size=6, max_size=6).map(np.array)


@given(st.sampled_from(sorted(BUILDS)), angles)
def test_two_implementations_of_the_kinematics_agree(model, joints):
    in_mm = EmulatedArm(BUILDS[model]).flange(joints)
    in_mm[:3, 3] *= 1000.0
    assert in_mm == pytest.approx(arm_for(model).forward(joints).matrix, abs=1e-9)


@settings(max_examples=30)
@given(angles, st.lists(st.floats(-0.1, 0.1), min_size=6, max_size=6))
def test_the_inverse_finds_joints_near_the_ones_at_hand(joints, aside):
    assume(float(arm_for("ur10e").singularity_margins(joints).least_deg) > 15.0)
    arm = EmulatedArm(BUILDS["ur10e"])
    found = arm.near(arm.flange(joints), joints + np.array(aside))
    assert arm.flange(found) == pytest.approx(arm.flange(joints), abs=1e-9)


@given(st.floats(1e-6, 5.0), st.floats(0.05, 3.0), st.floats(0.1, 10.0))
def test_a_trapezoid_covers_its_length_and_keeps_its_limits(length, speed, acceleration):
    way = Trapezoid(length, speed, acceleration)
    times = np.linspace(0.0, way.duration, 101)
    places, speeds = np.array([way.at(time) for time in times]).T
    assert places[0] == 0.0
    assert places[-1] == pytest.approx(length)
    assert np.all(np.diff(places) >= -1e-12)
    assert speeds.max() <= speed * (1 + 1e-9)
    assert np.abs(np.diff(speeds)).max() <= acceleration * way.duration / 100 * (1 + 1e-6)


def test_no_joint_is_driven_faster_than_the_arm_allows():
    arm = EmulatedArm(BUILDS["ur10e"])
    path = JointPath(arm, START, np.add(START, TURN), 9.0, 9.0)
    speeds = np.array([path.at(time)[1] for time in np.linspace(0, path.duration, 200)])
    assert np.abs(speeds[:, 0]).max() == pytest.approx(np.radians(120.0))
    assert path.at(path.duration)[0] == pytest.approx(np.add(START, TURN))


def test_a_line_is_straight_for_the_tcp_and_not_for_the_joints():
    arm, tcp = EmulatedArm(BUILDS["ur10e"]), matrix_of(np.array([0.02, 0.01, 0.15, 0.2, 0.0, 0.1]))
    here = pose_of(arm.flange(START) @ tcp)
    goal = np.add(here, [0.1, -0.2, 0.15, 0.1, 0.2, -0.1])
    line = LinePath(arm, START, (goal, tcp), 0.25, 0.5)
    between = np.array([pose_of(arm.flange(line.at(time)[0]) @ tcp)[:3]
                        for time in np.linspace(0, line.duration, 30)])
    way = (goal - here)[:3]
    off_the_line = np.cross(between - here[:3], way / np.linalg.norm(way))
    assert np.abs(off_the_line).max() < 1e-8
    assert between[-1] == pytest.approx(goal[:3], abs=1e-9)


def test_a_line_out_of_reach_is_refused_before_it_starts():
    arm = EmulatedArm(BUILDS["ur5e"])
    goal = np.add(pose_of(arm.flange(START)), [1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(UnreachableError):
        LinePath(arm, START, (goal, np.eye(4)), 0.25, 0.5)


def test_a_halt_starts_with_the_speed_it_found_and_ends_at_rest():
    speeds = np.array([0.5, -0.2, 0.1, 0.0, 0.3, 0.0])
    halt = Halt(START, speeds, 2.0)
    assert halt.duration == pytest.approx(0.25)
    assert halt.at(0.0)[1] == pytest.approx(speeds)
    assert halt.at(0.25)[1] == pytest.approx(np.zeros(6))
    assert halt.at(9.0)[0] == pytest.approx(START + speeds * 0.125)
