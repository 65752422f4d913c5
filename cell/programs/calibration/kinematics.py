"""The arm's own rows, as an option of a session: kept only where views kept apart gain by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cell.core.documents.base import as_six
from cell.core.documents.calibration import KinematicsDocument
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.hand_eye.calibration import HandEyeAnswer
from cell.metrology.calibrate.kinematics import JointView, KinematicResult, solve_kinematics
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.seen import SeenView
from cell.programs.calibration.stillness import measure_scatter

PLACES = 2  # of boards, at least
GAIN = 0.9  # of what the views kept apart have without, at most: less is chance


@dataclass(frozen=True, eq=False)
class KinematicsFound:
    """The estimate from boards in so many `places`, and how still (mm, rms) they stood without and
    with it in views apart.
    """

    result: KinematicResult
    document: KinematicsDocument
    places: int
    apart_without: float
    apart_with: float

    @property
    def useful(self) -> bool:
        """Whether the views kept apart gain, and boards in several places stand behind it: from one
        place the arm's rows are hardly told from the camera's mount.
        """
        return self.places >= PLACES and self.apart_with < GAIN * self.apart_without

    def __str__(self) -> str:
        return (f"kinematics, boards in {self.places} place{'s' * (self.places > 1)}: views kept "
                f"apart {self.apart_without:.3f} mm without, {self.apart_with:.3f} mm with the "
                f"arm's own rows: {'kept' if self.useful else 'not kept'}")


def find_kinematics(views: Sequence[SeenView], camera: CameraModel, answer: HandEyeAnswer,
                    belief: Belief) -> KinematicsFound | None:
    """Estimate the arm's rows from views of all places of the board; None where there are too few.

    At the first place they are those that the hand-eye was fitted to.
    """
    fitted = [view for view in views if view.record.number in answer.used
              or (view.record.place and view.record.purpose == "fit")]
    apart = [view for view in views if view.record.number in answer.apart
             or (view.record.place and view.record.purpose == "hold_out")]
    if answer.held_out is None or len(apart) < 2:
        return None
    mount = answer.held_out.result.carrier_from_camera
    boards = locate_boards([view.board for view in fitted], camera)
    result = solve_kinematics(
        [JointView(view.record.joints, board, str(view.record.place), view.record.pose)
         for view, board in zip(fitted, boards, strict=True)], belief.arm, mount)
    document = _document(result, belief.station.robot.model)
    with_rows = Chain(result.flange_from_camera, document)
    return KinematicsFound(result, document, len({view.record.place for view in fitted}),
                           measure_scatter(apart, camera, Chain(mount)),
                           measure_scatter(apart, camera, with_rows))


def _document(result: KinematicResult, model: str) -> KinematicsDocument:
    a, d, alpha, theta = (as_six([float(value) for value in part])
                          for part in result.residuals.reshape(4, 6))
    return KinematicsDocument(model=model, a=a, d=d, alpha=alpha, theta=theta)
