"""What every robot and every pair of lights must do, whichever way it is built.

Subclass with a fixture `robot` (a robot not opened yet) and, for the lights, `lights` and a fixture
`burning` that returns, without asking the implementation, the set of lights that burn.
"""

import math
import threading
import time
from itertools import pairwise

import numpy as np
import pytest

from cell.core.errors import DeviceError
from cell.core.ports import Move

SMALL = np.array([0.05, -0.04, 0.06, -0.05, 0.03, 0.1])
SPEED, ACCELERATION = 2.0, 6.0

WRONG_MOVES = [Move((math.nan,) * 6, 1.0, 1.0), Move((0.1,) * 5, 1.0, 1.0),
               Move((7.0,) * 6, 1.0, 1.0), Move((0.1,) * 6, 0.0, 1.0),
               Move((0.1,) * 6, 1.0, math.inf)]


def moves(*joint_vectors):
    return [Move(tuple(float(q) for q in joints), SPEED, ACCELERATION) for joints in joint_vectors]


@pytest.fixture
def opened(robot):
    robot.open()
    yield robot
    robot.close()


class RobotConformance:
    def test_it_says_who_it_is(self, robot):
        identity = robot.open()
        robot.close()
        assert identity.model
        assert identity.serial
        assert identity.software
        assert len(identity.tcp_offset) == 6
        assert identity.payload_kg >= 0.0

    def test_it_goes_through_a_path_and_reports_where_it_stands(self, opened):
        start = np.array(opened.state().joints)
        path = moves(start + SMALL, start - SMALL, start + 2 * SMALL)
        reached = opened.move_to(path)
        assert reached.still
        assert reached.joints == pytest.approx(path[-1].joints, abs=1e-3)
        again = opened.state()
        assert again.joints == pytest.approx(reached.joints, abs=1e-4)
        assert again.base_from_flange.distance(reached.base_from_flange)[0] < 0.05

    def test_an_empty_path_is_no_move(self, opened):
        before = opened.state()
        assert opened.move_to([]).joints == pytest.approx(before.joints, abs=1e-6)

    def test_each_state_is_newer_than_the_question(self, opened):
        times = [opened.state().controller_time for _ in range(5)]
        assert all(later > earlier for earlier, later in pairwise(times))

    def test_a_move_that_cannot_be_is_refused_before_anything_moves(self, opened):
        before = opened.state()
        good = moves(np.array(before.joints) + SMALL)
        for wrong in WRONG_MOVES:
            with pytest.raises(DeviceError):
                opened.move_to([*good, wrong])
        assert opened.state().joints == pytest.approx(before.joints, abs=1e-6)

    def test_stop_ends_a_move_from_another_thread_and_the_move_is_not_believed(self, opened):
        start = np.array(opened.state().joints)
        stopper = threading.Timer(0.3, opened.stop)
        stopper.start()
        begun = time.monotonic()
        with pytest.raises(DeviceError):
            opened.move_to([Move(tuple(start + 30 * SMALL), 0.2, 1.0)])
        stopper.join()
        assert time.monotonic() - begun < 10.0
        assert opened.state().still
        assert np.abs(np.array(opened.state().joints) - start - 30 * SMALL).max() > 0.1

    def test_after_a_stop_nothing_moves(self, opened):
        start = np.array(opened.state().joints)
        opened.stop()
        with pytest.raises(DeviceError):
            opened.move_to(moves(start + SMALL))
        assert opened.state().joints == pytest.approx(start, abs=1e-3)

    def test_after_a_stop_it_recovers_where_it_stands_and_moves_again(self, opened):
        start = np.array(opened.state().joints)
        opened.stop()
        assert opened.recover().joints == pytest.approx(start, abs=1e-3)
        reached = opened.move_to(moves(start + SMALL))
        assert reached.joints == pytest.approx(start + SMALL, abs=1e-3)

    def test_closing_is_idempotent_and_ends_everything(self, opened):
        opened.close()
        opened.close()
        opened.stop()
        with pytest.raises(DeviceError):
            opened.state()
        with pytest.raises(DeviceError):
            opened.move_to([])

    def test_what_was_never_opened_neither_moves_nor_fails_to_close(self, robot):
        with pytest.raises(DeviceError):
            robot.state()
        robot.stop()
        robot.close()

    def test_it_opens_again_after_closing(self, opened):
        opened.close()
        opened.open()
        assert opened.state().still


class LightsConformance:
    def test_exactly_one_light_burns(self, opened, lights, burning):
        for light in ("ring", "laser", "ring", "laser"):
            lights.set(light)
            assert burning() == {light}
        lights.set(None)
        assert burning() == set()

    def test_off_switches_both_off_however_often(self, opened, lights, burning):
        lights.set("laser")
        lights.off()
        lights.off()
        assert burning() == set()

    def test_stopping_or_closing_the_robot_darkens_the_laser(self, opened, lights, burning):
        lights.set("laser")
        opened.stop()
        assert burning() == set()
        lights.off()
        with pytest.raises(DeviceError):
            lights.set("laser")
        assert burning() == set()
        opened.close()
        lights.off()
