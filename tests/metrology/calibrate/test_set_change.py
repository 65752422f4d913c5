"""A set held against the one before: what uncertainty explains, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest
from made_sessions import MOUNTED, SMALL

from cell.core.geometry import Plane, Transform
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.calibrate.gates import check_gates
from cell.metrology.calibrate.set_change import Calibrated, changes
from cell.metrology.motions import nudge
from cell.programs.calibration.recorded import read_gates

MOUNT = np.diag(np.repeat([np.radians(0.008), 0.04], 3) ** 2)
PLANE = np.diag([1e-5, 1e-5, 1e-5, 3e-3]) ** 2
FOCAL = np.diag([0.5, 0.5, 1, 1, 0, 0, 0, 0, 0]) ** 2
SENSOR = SensorModel(SMALL, Plane.from_coefficients((0.8, 0.05, 0.6, -150.0)), FOCAL, PLANE)
BEFORE = Calibrated(SENSOR, MOUNTED, MOUNT)


def drawn(rng):
    """The same sensor calibrated once more: plane and mount go along with the camera."""
    plane, off = SENSOR.light_plane, rng.normal(0.0, np.sqrt(np.diag(FOCAL)))
    matrix = SMALL.matrix + np.array([[off[0], 0, off[2]], [0, off[1], off[3]], [0, 0, 0]])
    seems = SENSOR.working_distance / 1620.0 * np.array([-off[2], -off[3], off[0]])
    step = rng.normal(0.0, [1e-5, 1e-5, 1e-5, 3e-3])
    moved = Plane.from_coefficients((*(plane.normal + step[:3]),
                                     plane.offset + step[3] - plane.normal @ seems))
    mount = nudge(MOUNTED, rng.normal(0.0, np.sqrt(np.diag(MOUNT))))
    return Calibrated(SensorModel(CameraModel(SMALL.image_size, matrix, SMALL.distortion), moved,
                                  FOCAL, PLANE),
                      mount @ Transform.from_parts(np.zeros(3), -seems), MOUNT)


def test_the_same_set_has_not_changed():
    assert max(changes(BEFORE, BEFORE).values()) < 1e-6


def test_what_was_only_measured_again_passes():
    rng = np.random.default_rng(3)
    found = [changes(drawn(rng), drawn(rng)) for _ in range(300)]
    for name in ("hand_eye", "light_plane", "focal"):
        values = np.array([change[name] for change in found])
        assert np.mean(values <= 1.0) >= 0.93
        assert np.sqrt(np.mean(values ** 2)) == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize(("name", "changed"), [
    ("hand_eye", replace(BEFORE, flange_from_camera=MOUNTED @ Transform.from_parts(
        np.zeros(3), [0.9, -0.6, 0.3]))),
    ("hand_eye", replace(BEFORE, flange_from_camera=MOUNTED @ Transform.from_parts(
        np.radians([0.3, 0.0, 0.0]), np.zeros(3)))),
    ("light_plane", replace(BEFORE, sensor=replace(SENSOR, light_plane=Plane.from_coefficients(
        (0.8, 0.05, 0.6, -151.0))))),
    ("focal", replace(BEFORE, sensor=replace(SENSOR, camera=CameraModel(
        SMALL.image_size, SMALL.matrix + np.diag([4.0, 4.0, 0.0]), SMALL.distortion)))),
])
def test_a_real_change_has_to_be_explained_and_is_never_refused(name, changed):
    found = changes(BEFORE, changed)
    gate, = [gate for gate in check_gates(found, read_gates().fine.last_set)
             if gate.verdict != "pass"]
    assert gate.name == name and found[name] > 1.5
    assert gate.verdict == "warn" and "say why" in gate.limit


def test_mounts_with_and_without_the_arms_own_rows_are_not_compared():
    other = replace(drawn(np.random.default_rng(1)), arm_known=True)
    assert set(changes(BEFORE, other)) == {"light_plane", "focal"}


def test_without_any_uncertainty_nothing_can_be_said():
    bare = Calibrated(SensorModel(SMALL, SENSOR.light_plane), MOUNTED, None)
    other = replace(drawn(np.random.default_rng(2)), covariance=None)
    assert set(changes(bare, other)) == {"light_plane", "focal"}
    assert changes(bare, bare) == {}
