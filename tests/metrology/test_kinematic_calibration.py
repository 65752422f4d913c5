"""The arm's rows from board views: what a body's holes gain, on an arm that is off."""

import numpy as np
from made_arms import ArmWorld

from cell.metrology.kinematic_calibration import solve_kinematics


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_holes_are_found_better_with_the_arms_own_rows():
    nominal, corrected = [], []
    for seed in (0, 2):
        world = ArmWorld(seed)
        mount = world.hand_eye()
        result = solve_kinematics(world.views, world.nominal, mount)
        nominal.append(world.holes_missed_by(world.nominal, mount))
        corrected.append(world.holes_missed_by(result.arm, result.flange_from_camera))
        assert result.chi2 < 0.2 * result.chi2_before
    assert rms(corrected) < 0.15
    assert rms(corrected) < 0.6 * rms(nominal)


def test_an_arm_that_is_right_is_left_alone():
    world = ArmWorld(4, off=0.0)
    result = solve_kinematics(world.views, world.nominal, world.mounted)
    lengths, angles = result.residuals[:12], np.degrees(result.residuals[12:])
    assert result.notable == ()
    assert np.abs(lengths).max() < 0.15 and np.abs(angles).max() < 0.02
    missed = world.holes_missed_by(result.arm, result.flange_from_camera)
    assert missed < world.holes_missed_by(world.nominal, world.mounted) + 0.05
