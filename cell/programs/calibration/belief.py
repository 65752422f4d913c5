"""What a session starts from: the cell's papers, the active set, and the board to look at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.archive.files import read_text
from cell.archive.sets import active_set, cell_folder, read_set
from cell.core.documents.calibration import (
    HandEyeDocument,
    KinematicsDocument,
    SensorDocument,
)
from cell.core.documents.station import StationDocument
from cell.core.documents.targets import BoardDocument, TargetsDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.core.kinematics import Arm, arm_for
from cell.core.optics import SensorModel
from cell.core.ports import Joints
from cell.metrology.calibrate.detect_board import BoardDesign
from cell.metrology.detect.ridge import runs_upright
from cell.programs.calibration.chain import Chain


@dataclass(frozen=True, eq=False)
class Belief:
    """A cell before its calibration: `set_id` is the active set, right to millimetres at least."""

    folder: Path
    station: StationDocument
    targets: TargetsDocument
    set_id: str
    sensor_document: SensorDocument
    hand_eye: HandEyeDocument
    kinematics: KinematicsDocument | None = None

    @property
    def home(self) -> Joints:
        """Where the arm begins and ends (rad)."""
        return tuple(float(angle) for angle in np.radians(self.station.home_deg))

    @property
    def chain(self) -> Chain:
        """The way from the camera to the base as believed."""
        return Chain(self.flange_from_camera, self.kinematics)

    @property
    def sensor(self) -> SensorModel:
        """The sensor as believed."""
        return self.sensor_document.model

    @property
    def flange_from_camera(self) -> Transform:
        """The hand-eye transform as believed."""
        return Transform(np.array(self.hand_eye.flange_from_camera))

    @property
    def arm(self) -> Arm:
        """The arm by its model."""
        return arm_for(self.station.robot.model)

    @property
    def upright(self) -> bool:
        """Whether the stripe runs along the image's columns."""
        return runs_upright(self.sensor.light_plane)

    def board(self, name: str | None) -> BoardDocument:
        """Choose a board by its id; the first where none is named.

        Raises:
            DocumentError: there is no such board.
        """
        boards = {board.id: board for board in self.targets.boards}
        chosen = boards.get(name) if name else next(iter(boards.values()), None)
        if chosen is None:
            raise DocumentError(f"there is no board {name!r}; known: {', '.join(boards) or 'none'}",
                                source=str(self.folder / "targets.yaml"))
        return chosen


def read_belief(calibration: Path, cell: str) -> Belief:
    """Read the papers that a calibration starts from.

    Raises:
        DocumentError: one is absent or wrong.
    """
    folder = cell_folder(calibration, cell)
    set_id = active_set(folder)
    found = read_set(folder, set_id)
    kinematics = (parse(KinematicsDocument, found.texts["kinematics"], found.sources["kinematics"])
                  if "kinematics" in found.texts else None)
    station, targets = (folder / name for name in ("cell.yaml", "targets.yaml"))
    return Belief(folder, parse(StationDocument, read_text(station), str(station)),
                  parse(TargetsDocument, read_text(targets), str(targets)), set_id,
                  parse(SensorDocument, found.texts["sensor"], found.sources["sensor"]),
                  parse(HandEyeDocument, found.texts["hand_eye"], found.sources["hand_eye"]),
                  kinematics)


def design_of(board: BoardDocument) -> BoardDesign:
    """The board as detection takes it."""
    return BoardDesign(board.squares, board.square_mm, board.marker_mm, board.dictionary)
