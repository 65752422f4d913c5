"""The figures of a hand-eye session that the gates look at, and what limits the result."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cell.core.geometry import Transform
from cell.metrology.calibrate.gates import Gate
from cell.metrology.calibrate.hand_eye.check import HeldOut, object_rms
from cell.metrology.calibrate.hand_eye.diagnosis import as_given
from cell.metrology.calibrate.hand_eye.diagnosis_fit import CameraCheck
from cell.metrology.calibrate.hand_eye.diversity import measure_diversity
from cell.metrology.calibrate.hand_eye.explanations import Explanation
from cell.metrology.calibrate.hand_eye.readings import angle_gap
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem
from cell.metrology.calibrate.hand_eye.start import solve_park

SYSTEMATIC = 3.0  # chi2 from which more than the expected noise is at work


def input_figures(session: HandEyeSession, camera: CameraCheck | None,
                  scale: Explanation) -> dict[str, float]:
    """Measure what the session is worth before any solution."""
    diversity = measure_diversity(as_given(session).camera_from_board)
    split_half = float("nan") if camera is None else camera.own.split_half
    return {"pnp_rms_px": session.pnp_rms_px,
            "split_half_percent": 100.0 * split_half,
            "tilt_range_deg": diversity.tilt_range_deg,
            "roll_range_deg": diversity.roll_range_deg,
            "axis_spread": diversity.axis_spread,
            "angle_gap_deg": float(np.degrees(angle_gap(as_given(session)))),
            "board_scale_percent": 100.0 * abs(float(scale.values[0]))}


def fit_figures(session: HandEyeSession, problem: HandEyeProblem,
                held_out: HeldOut) -> dict[str, float]:
    """Measure how well the solution holds, on the views fitted and on others."""
    result, distance = held_out.result, session.working_distance
    still = object_rms(problem, result.carrier_from_camera)
    park = solve_park(problem.reference_from_carrier, problem.camera_from_board)
    return {"used_views": len(result.used),
            "object_rms_mm": still,
            "chi2": result.chi2,
            "point_sigma_mm": result.point_sigma(distance),
            "rotation_sigma_deg": float(np.degrees(result.rotation_sigma)),
            "closed_form_gap_mm": _gap(park, result.carrier_from_camera, distance),
            "holdout_rms_mm": held_out.rms,
            "holdout_ratio": held_out.rms / max(still, 1e-9),
            "working_distance_mm": distance}


def what_limits(figures: Mapping[str, float], camera: CameraCheck | None,
                gates: Mapping[str, Gate]) -> str:
    """Say in a sentence what to improve first."""
    if camera is not None and (camera.doubtful or figures["split_half_percent"]
                               > 2.0 * (gates["split_half_percent"].at_most or 0.0)):
        return "The intrinsics limit the result: calibrate the camera again."
    for name, what in (("tilt_range_deg", "tilted"), ("roll_range_deg", "rolled")):
        if gates[name].rule(figures[name]) != "pass":
            return f"The spread of the rotations limits the result: add views that are {what} more."
    if figures["chi2"] > SYSTEMATIC:
        return ("The robot limits the result (or the board is not flat): the views disagree by "
                f"{figures['object_rms_mm']:.2f} mm, {figures['chi2'] ** 0.5:.1f} times what noise "
                "explains. More views will not help; calibrate the arm's kinematics.")
    if gates["pnp_rms_px"].rule(figures["pnp_rms_px"]) != "pass":
        return "The corners limit the result: look at focus, exposure and the board's print."
    return ("The robot's repeatability limits the result: "
            f"{figures['object_rms_mm']:.2f} mm between views is what noise explains.")


def _gap(one: Transform, other: Transform, distance: float) -> float:
    point = np.array([0.0, 0.0, distance])
    return float(np.linalg.norm(one @ point - other @ point))
