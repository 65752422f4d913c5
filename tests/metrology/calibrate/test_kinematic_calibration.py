"""The arm's rows from board views: what a body's holes gain, on an arm that is off."""

from dataclasses import replace

import numpy as np
import pytest
from made_arms import ArmWorld

from cell.core.documents.calibration import KinematicsDocument
from cell.metrology.calibrate.kinematics import solve_kinematics, with_rows
from cell.metrology.measure.arm_correction import correct_flange


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


FACTORY = np.random.default_rng(9).normal(0.0, 1.0, 24) * np.repeat([0.6, 0.6, 1e-3, 1e-3], 6)


class FactoryWorld(ArmWorld):
    """The same arm under a controller with a factory calibration, which its poses have in them."""

    def reported(self, joints):
        return with_rows(self.nominal, FACTORY).forward(joints)

    def _view(self, name, base_from_board):
        view = super()._view(name, base_from_board)
        return view and replace(view, base_from_reported=self.reported(view.joints))

    @property
    def true(self):
        """The arm that stands where the reported pose, put right by the rows drawn, says."""
        return self._own

    @true.setter
    def true(self, arm):
        drawn = np.concatenate([np.subtract(getattr(arm, name), getattr(self.nominal, name))
                                for name in ("a", "d", "alpha", "theta")])
        self._own = with_rows(self.nominal, drawn + FACTORY)


def test_a_factory_calibration_in_the_reported_poses_is_not_counted_twice():
    plain, world = ArmWorld(2), FactoryWorld(2)
    expected = solve_kinematics(plain.views, plain.nominal, plain.mounted).residuals
    result = solve_kinematics(world.views, world.nominal, world.mounted)
    a, d, alpha, theta = (tuple(map(float, rows)) for rows in result.residuals.reshape(4, 6))
    document = KinematicsDocument(model="ur10e", a=a, d=d, alpha=alpha, theta=theta)
    assert result.residuals[:12] == pytest.approx(expected[:12], abs=0.03)
    seen = np.delete(np.arange(12, 24), 6)  # joint 1's zero trades against where the boards lie
    assert result.residuals[seen] == pytest.approx(expected[seen], abs=1e-4)
    left, unaided = [], []
    for view in world.views[::3]:
        reported, true = view.base_from_reported, world.true.forward(view.joints)
        chained = correct_flange(reported, view.joints, document) @ result.flange_from_camera
        left.append(chained.distance(true @ world.mounted)[0])
        unaided.append(reported.distance(true)[0])
    print(f"\nunaided {rms(unaided):.3f}, left {rms(left):.3f} mm")
    assert rms(left) < 0.5 * rms(unaided)
