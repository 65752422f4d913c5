"""The true arm is wrong in the ways and by the amounts that the scene says."""

import numpy as np
import pytest

from cell.core.kinematics import arm_for
from cell.sim.arm import TrueArm
from cell.sim.scene import ArmScene

MODEL = arm_for("ur10e")
JOINTS = np.radians([153.0, -93.0, 114.0, -13.0, 59.0, 164.0])
PERFECT = ArmScene(model="ur10e")


def flange(arm, joints, time=1e9):
    arm.follow(joints, time - 1000.0)
    return arm.flange(MODEL.forward(joints), joints, time)


def other(joints, by=0.3):
    return joints + by


@pytest.mark.parametrize("scene", [PERFECT, ArmScene(
    model="ur10e", ideal=True, length_mm=1.0, angle_deg=1.0, hysteresis_deg=1.0,
    repeatability_deg=1.0, cold_mm=1.0)])
def test_an_ideal_arm_stands_where_it_is_said_to_stand(scene):
    millimetres, angle = flange(TrueArm(scene, 1), JOINTS, 0.0).distance(MODEL.forward(JOINTS))
    assert millimetres < 1e-9
    assert angle < 1e-9


def test_kinematics_err_the_same_at_the_same_place_and_otherwise_elsewhere():
    arm = TrueArm(PERFECT.model_copy(update={"length_mm": 0.1, "angle_deg": 0.02}), 3)
    first = flange(arm, JOINTS)
    flange(arm, other(JOINTS))
    assert first.distance(flange(arm, JOINTS))[0] < 1e-9
    off = [flange(arm, q).translation - MODEL.forward(q).translation
           for q in (JOINTS, other(JOINTS, 1.0))]
    assert 0.05 < np.linalg.norm(off[0]) < 3.0
    assert np.linalg.norm(off[0] - off[1]) > 0.02


def test_hysteresis_depends_on_the_side_from_which_a_joint_came():
    arm = TrueArm(PERFECT.model_copy(update={"hysteresis_deg": 0.01}), 3)
    places = {}
    for side in (1, -1, 1, -1):
        flange(arm, JOINTS - 0.2 * side)
        places.setdefault(side, []).append(flange(arm, JOINTS).translation)
    assert np.linalg.norm(places[1][0] - places[1][1]) < 1e-9
    assert np.linalg.norm(places[1][0] - places[-1][0]) > 0.02


def test_every_standstill_errs_anew_but_stays_while_it_stands():
    arm = TrueArm(PERFECT.model_copy(update={"repeatability_deg": 0.003}), 3)
    stood = []
    for _ in range(200):
        flange(arm, other(JOINTS))
        there = flange(arm, JOINTS)
        assert there.distance(flange(arm, JOINTS))[0] == 0.0
        stood.append(there.translation)
    spread = np.array(stood).std(axis=0)
    assert np.linalg.norm(spread) == pytest.approx(0.06, rel=0.6)
    assert np.linalg.norm(np.mean(stood, axis=0) - MODEL.forward(JOINTS).translation) < 0.02


def test_after_a_stop_it_swings_and_settles():
    arm = TrueArm(PERFECT.model_copy(update={"sway_deg": 0.01, "sway_s": 0.05}), 3)
    arm.follow(other(JOINTS), 0.0)
    arm.follow(JOINTS, 1.0)
    reported = MODEL.forward(JOINTS)
    off = [arm.flange(reported, JOINTS, 1.0 + wait).distance(reported)[0]
           for wait in (0.0, 0.1, 0.2, 0.5)]
    assert off[0] > 0.1
    assert off[1] < 0.2 * off[0]
    assert off[2] < 0.03 * off[0]
    assert off[3] < 1e-4


def test_a_cold_arm_is_short_and_warms_up():
    arm = TrueArm(PERFECT.model_copy(update={"cold_mm": 0.1, "warm_up_s": 600.0}), 3)
    straight = np.array([0.1, -0.4, 0.02, 0.3, 1.2, 0.1])
    reach = [np.linalg.norm(flange(arm, straight, time).translation[:2])
             for time in (0.0, 600.0, 6000.0)]
    nominal = np.linalg.norm(MODEL.forward(straight).translation[:2])
    assert nominal - reach[0] == pytest.approx(0.2, rel=0.2)
    assert (nominal - reach[1]) / (nominal - reach[0]) == pytest.approx(np.exp(-1), rel=0.01)
    assert abs(nominal - reach[2]) < 1e-4
