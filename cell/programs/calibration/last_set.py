"""A solution held against the set that the cell measures with until now."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import SensorModel
from cell.metrology.calibrate.gates import Level, check_gates
from cell.metrology.calibrate.set_change import Calibrated, changes, softened
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.recorded import read_gates
from cell.programs.calibration.solve import Solution, chain_of


def with_last_set(solution: Solution, belief: Belief, level: Level) -> Solution:
    """Add the gates against the active set: more than both uncertainties has to be explained."""
    before, now = _before(belief), _now(solution, belief)
    softer = softened(before, now)
    figures = changes(before, now) | (
        {} if softer is None else {"blur_percent": 100.0 * abs(softer)})
    checks = check_gates(figures, read_gates().level(level).last_set)
    return replace(solution, gates=solution.gates | ({"last set": checks} if checks else {}))


def _before(belief: Belief) -> Calibrated:
    return Calibrated(belief.sensor, belief.flange_from_camera, _rows(belief.hand_eye.covariance),
                      belief.kinematics is not None)


def _now(solution: Solution, belief: Belief) -> Calibrated:
    """What was solved now; what was not is as before."""
    sensor, plane = belief.sensor, solution.light_plane
    camera, chain = solution.camera_result, chain_of(solution, belief)
    held_out = solution.hand_eye and solution.hand_eye.held_out
    return Calibrated(
        SensorModel(solution.camera, plane.plane if plane else sensor.light_plane,
                    camera.covariance if camera else sensor.camera_covariance,
                    plane.covariance if plane else sensor.light_plane_covariance),
        chain.flange_from_camera,
        held_out.result.covariance[:6, :6] if held_out else _rows(belief.hand_eye.covariance),
        chain.kinematics is not None)


def _rows(covariance: tuple[tuple[float, ...], ...] | None) -> Array | None:
    return None if covariance is None else np.array(covariance, dtype=np.float64)
