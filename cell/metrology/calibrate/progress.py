"""How far a session has come while it is captured: what of its gates can be told by then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardPose, BoardView
from cell.metrology.calibrate.camera import TILTED, CameraResult, solve_camera
from cell.metrology.calibrate.gates import Checked, Gate, GateSet, check_gates
from cell.metrology.calibrate.hand_eye.diversity import measure_diversity
from cell.metrology.calibrate.light_plane import LightPlaneResult, StripeOnBoard, solve_light_plane
from cell.metrology.motions import stack

SPARE = 2    # views that a fit may leave out as outliers
DEPTH = 44.0  # mm over which a light plane should have been seen: the depth of field


@dataclass(frozen=True, eq=False)
class GatheredView:
    """A view that will be fitted to: its corners, where the board was, the stripe (n, 2) px."""

    seen: BoardView
    board: BoardPose
    stripe: Array | None = None


def check_progress(views: Sequence[GatheredView], camera: CameraModel, gates: GateSet,
                   steps: Sequence[str]) -> tuple[Checked, ...]:
    """Hold the figures that are known by now against the gates of these steps.

    Camera and light plane are solved, each by itself: that is cheap, and what they are worth hangs
    on more than the number of views.

    Args:
        views: two at least.
        camera: as believed; the image's size and the rays of the stripe come from it.
        gates: of the session's level.
        steps: of `camera`, `light_plane`, `hand_eye`.
    """
    figures: dict[str, Mapping[str, float]] = {
        "camera": _of_camera(views, camera), "light_plane": _of_plane(views, camera),
        "hand_eye": _of_hand_eye(views)}
    return tuple(checked for step in steps
                 for checked in check_gates(figures[step], _with_spare(getattr(gates, step))))


def _with_spare(gates: Mapping[str, Gate]) -> dict[str, Gate]:
    """Want some views more than the fit has to keep."""
    return {name: gate.model_copy(update={"at_least": (gate.at_least or 0) + SPARE})
            if name == "used_views" else gate for name, gate in gates.items()}


def camera_figures(result: CameraResult) -> dict[str, float]:
    """What the gates of the camera look at."""
    blur = result.blur
    figures = {} if blur is None else {"blur_px": blur.value,
                                       "blur_spread_percent": 100.0 * blur.spread / blur.value}
    return figures | {"rms_px": result.rms_px, "views": len(result.residuals),
                      "tilted_views": int(np.sum(result.tilts > TILTED)),
                      "covered_percent": 100.0 * result.covered,
                      "split_half_percent": 100.0 * result.split_half}


def plane_figures(result: LightPlaneResult) -> dict[str, float]:
    """What the gates of the light plane look at."""
    near, far = result.depths
    return {"poses": len(result.residuals),
            "depth_percent": min(100.0, 100.0 * (far - near) / DEPTH),
            "rms_mm": result.rms, "left_out_mm": result.left_out_rms,
            "normal_sigma_deg": float(np.degrees(result.normal_sigma))}


def _of_camera(views: Sequence[GatheredView], camera: CameraModel) -> dict[str, float]:
    try:
        return camera_figures(solve_camera([view.seen for view in views], camera.image_size,
                                           camera))
    except UnmeasurableError:
        return {"views": len(views)}


def _of_plane(views: Sequence[GatheredView], camera: CameraModel) -> dict[str, float]:
    stripes = [StripeOnBoard(view.stripe, view.board.camera_from_board)
               for view in views if view.stripe is not None]
    try:
        return plane_figures(solve_light_plane(stripes, camera))
    except UnmeasurableError:
        return {"poses": len(stripes)}


def _of_hand_eye(views: Sequence[GatheredView]) -> dict[str, float]:
    spread = measure_diversity(stack(view.board.camera_from_board for view in views))
    return {"used_views": len(views), "tilt_range_deg": spread.tilt_range_deg,
            "roll_range_deg": spread.roll_range_deg, "axis_spread": spread.axis_spread}
