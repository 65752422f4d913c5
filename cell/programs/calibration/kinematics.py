"""The arm's own rows, as an option of a session: kept only where views kept apart gain by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.documents.calibration import KinematicsDocument
from cell.core.geometry import Array, Transform
from cell.core.optics import CameraModel
from cell.metrology.arm_correction import correct_flange
from cell.metrology.board_pose import locate_boards
from cell.metrology.hand_eye_calibration import HandEyeAnswer
from cell.metrology.kinematic_calibration import JointView, KinematicResult, solve_kinematics
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.capture import as_six
from cell.programs.calibration.seen import SeenView


@dataclass(frozen=True, eq=False)
class KinematicsFound:
    """The estimate, and how still (mm, rms) the board stood without and with it in views apart."""

    result: KinematicResult
    document: KinematicsDocument
    apart_without: float
    apart_with: float

    @property
    def useful(self) -> bool:
        """Whether the views kept apart gain."""
        return self.apart_with < self.apart_without


def find_kinematics(views: Sequence[SeenView], camera: CameraModel, answer: HandEyeAnswer,
                    belief: Belief) -> KinematicsFound | None:
    """Estimate the arm's rows from the views that the hand-eye was fitted to."""
    fitted = [view for view in views if view.record.number in answer.used]
    apart = [view for view in views if view.record.number in answer.apart]
    if answer.held_out is None or len(apart) < 2:
        return None
    mount = answer.held_out.result.carrier_from_camera
    boards = locate_boards([view.board for view in fitted], camera)
    result = solve_kinematics(
        [JointView(view.record.joints, board, base_from_reported=view.record.pose)
         for view, board in zip(fitted, boards, strict=True)], belief.arm, mount)
    document = _document(result, belief.station.robot.model)
    return KinematicsFound(result, document, _restless(apart, camera, mount, None),
                           _restless(apart, camera, result.flange_from_camera, document))


def _document(result: KinematicResult, model: str) -> KinematicsDocument:
    a, d, alpha, theta = (as_six([float(value) for value in part])
                          for part in result.residuals.reshape(4, 6))
    return KinematicsDocument(model=model, a=a, d=d, alpha=alpha, theta=theta)


def _restless(views: Sequence[SeenView], camera: CameraModel, mount: Transform,
              document: KinematicsDocument | None) -> float:
    """How far the middle of the board moves between views (mm, rms about its mean)."""
    middle = np.concatenate([view.board.points_in_board for view in views]).mean(axis=0)
    places: list[Array] = [
        correct_flange(view.record.pose, view.record.joints, document) @ mount
        @ board.camera_from_board @ middle
        for view, board in zip(views, locate_boards([view.board for view in views], camera),
                               strict=True)]
    spread = np.array(places) - np.mean(places, axis=0)
    return float(np.sqrt(np.mean(np.sum(spread ** 2, axis=1))))
