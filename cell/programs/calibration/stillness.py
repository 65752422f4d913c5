"""How still the board stands, view by view: by the set before, and by what was solved now."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cell.core.geometry import Array
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.motions import lay_onto
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.seen import SeenView
from cell.programs.calibration.solve import Solution, chain_of


def before_and_after(solution: Solution, belief: Belief) -> tuple[Array, Array] | None:
    """Measure how far (n,) mm each view misses the mean board; None without a hand-eye."""
    if solution.hand_eye is None or not solution.views:
        return None
    return (measure_stillness(solution.views, belief.sensor.camera, belief.chain),
            measure_stillness(solution.views, solution.camera, chain_of(solution, belief)))


def measure_stillness(views: Sequence[SeenView], camera: CameraModel, chain: Chain) -> Array:
    """Carry the corners of every view to the base, and hold them against the board laid onto all.

    Returns the miss (n,) of each view, mm rms.
    """
    boards = locate_boards([view.board for view in views], camera)
    carried = [chain.base_from_camera(view.record.pose, view.record.joints)
               @ board.camera_from_board @ board.points_in_board
               for view, board in zip(views, boards, strict=True)]
    mean = lay_onto(np.concatenate([board.points_in_board for board in boards]),
                    np.concatenate(carried))
    return np.array([np.sqrt(np.mean(np.sum((some - mean @ board.points_in_board) ** 2, axis=1)))
                     for some, board in zip(carried, boards, strict=True)])
