"""One look: the order of its steps, and what follows when the arm moves or an image is late."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.core.geometry import Transform
from cell.core.ports import CameraTimeoutError
from cell.programs.inspection.look import TRIES, look

EXPOSURES = {"ring": 0.02, "laser": 0.05}


class ScriptedStation:
    """Devices that write down what is asked of them; the arm creeps as `steps` (mm) say."""

    def __init__(self, steps=(), late=0):
        self.asked, self.steps, self.late, self.x = [], list(steps), late, 0.0
        self.document = SimpleNamespace(
            still_mm=0.05, still_rad=1e-3,
            robot=SimpleNamespace(settle_s=0.2, light_rise_s=0.02))
        self.robot = self.lights = self.camera = self

    def pause(self, seconds, since):
        self.asked.append(f"wait {seconds}")

    def set(self, light):
        self.asked.append(light)

    def off(self):
        self.asked.append("off")

    def state(self):
        self.asked.append("pose")
        self.x += self.steps.pop(0) if self.steps else 0.0
        return SimpleNamespace(base_from_flange=Transform.from_parts(np.zeros(3), (self.x, 0, 0)),
                               joints=(self.x,) * 6)

    def snap(self, exposure):
        self.asked.append(f"snap {exposure}")
        if self.late:
            self.late -= 1
            raise CameraTimeoutError("late", device="camera")
        return np.zeros((2, 3), np.uint8)


def test_the_laser_rises_while_the_pose_is_read_and_burns_no_longer_than_needed():
    station = ScriptedStation()
    ring, laser = look(station, EXPOSURES, 3)
    assert station.asked == [
        "ring", "wait 0.2", "wait 0.02", "pose", "snap 0.02",
        "laser", "pose", "wait 0.02", "snap 0.05", "pose", "off"]
    assert (ring.light, ring.exposure, ring.attempt) == ("ring", 0.02, 3)
    assert (laser.light, laser.exposure, laser.attempt) == ("laser", 0.05, 3)


def test_each_view_has_the_poses_round_its_own_exposure():
    ring, laser = look(ScriptedStation(steps=[1.0, 0.01, 0.02]), EXPOSURES, 0)
    reached = [pose.translation[0] for pose in (
        ring.base_from_flange_before, ring.base_from_flange_after,
        laser.base_from_flange_before, laser.base_from_flange_after)]
    np.testing.assert_allclose(reached, [1.0, 1.01, 1.01, 1.03])
    assert laser.joints == pytest.approx((1.01,) * 6)


@pytest.mark.parametrize("steps", [[0.0, 1.0], [0.0, 0.0, 1.0]])
def test_both_pictures_are_taken_again_when_the_arm_moved_during_either(steps):
    station = ScriptedStation(steps)
    ring, laser = look(station, EXPOSURES, 0)
    assert station.asked.count("snap 0.02") == station.asked.count("snap 0.05") == 2
    assert ring.base_from_flange_before.distance(laser.base_from_flange_after)[0] == 0.0


def test_an_arm_that_never_rests_is_shown_as_it_is():
    station = ScriptedStation(steps=[1.0] * 99)
    ring, _ = look(station, EXPOSURES, 0)
    assert station.asked.count("snap 0.02") == TRIES
    assert ring.base_from_flange_before.distance(ring.base_from_flange_after)[0] == 1.0


def test_a_late_image_is_asked_for_again_and_a_dead_camera_ends_the_look_in_the_dark():
    assert look(ScriptedStation(late=TRIES - 1), EXPOSURES, 0)
    station = ScriptedStation(late=99)
    with pytest.raises(CameraTimeoutError):
        look(station, EXPOSURES, 0)
    assert station.asked.count("snap 0.02") == TRIES
    assert station.asked[-1] == "off"
