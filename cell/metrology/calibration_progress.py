"""How far a session has come while it is captured: figures of the gates that views alone decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.board_pose import BoardPose, BoardView
from cell.metrology.calibration_gates import Checked, GateSet, check_gates
from cell.metrology.camera_calibration import TILTED, coverage
from cell.metrology.diversity import measure_diversity
from cell.metrology.light_plane import StripeOnBoard
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
    """Hold the figures that are known without a solution against the gates of these steps.

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
                 for checked in check_gates(figures[step], getattr(gates, step)))


def depth_percent(depths: tuple[float, float]) -> float:
    """Say how much (%) of the depth of field lies between the nearest and the farthest (mm)."""
    return min(100.0, 100.0 * (depths[1] - depths[0]) / DEPTH)


def _of_camera(views: Sequence[GatheredView], camera: CameraModel) -> dict[str, float]:
    hit = coverage([view.seen for view in views], camera.image_size) > 0
    return {"views": len(views), "covered_percent": 100.0 * float(np.mean(hit)),
            "tilted_views": sum(view.board.tilt > TILTED for view in views)}


def _of_plane(views: Sequence[GatheredView], camera: CameraModel) -> dict[str, float]:
    depths = [StripeOnBoard(view.stripe, view.board.camera_from_board).meet(camera)[:, 2]
              for view in views if view.stripe is not None]
    ends = (float(min(map(np.min, depths))), float(max(map(np.max, depths)))) if depths \
        else (0.0, 0.0)
    return {"poses": len(depths), "depth_percent": depth_percent(ends)}


def _of_hand_eye(views: Sequence[GatheredView]) -> dict[str, float]:
    spread = measure_diversity(stack(view.board.camera_from_board for view in views))
    return {"used_views": len(views) - SPARE, "tilt_range_deg": spread.tilt_range_deg,
            "roll_range_deg": spread.roll_range_deg, "axis_spread": spread.axis_spread}
