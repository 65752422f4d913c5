"""One view of a session as detection sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cell.core.documents.calibration_session import ViewRecord
from cell.core.documents.targets import BoardDocument
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.calibrate.board_blur import SeenEdges, find_edges
from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.detect_board import detect_board
from cell.metrology.calibrate.detect_board_stripe import detect_board_stripe
from cell.programs.calibration.belief import Belief, design_of
from cell.programs.calibration.session import Session


@dataclass(frozen=True, eq=False)
class SeenView:
    """What a view shows: the board's corners, the stripe (n, 2) px where one was found, and the
    edges between the board's squares.
    """

    record: ViewRecord
    board: BoardView
    stripe: Array | None
    edges: SeenEdges | None = None


def see_view(record: ViewRecord, ring: Image, stripe: Image, belief: Belief,
             document: BoardDocument) -> SeenView:
    """Detect board and stripe in the two pictures of a view.

    Raises:
        UnmeasurableError: no board.
    """
    design = design_of(document)
    board = detect_board(ring, design).view
    seen = SeenView(record, board, None, find_edges(ring, board, design))
    try:
        points = detect_board_stripe(stripe, ring, belief.sensor.camera, upright=belief.upright)
    except UnmeasurableError:
        return seen
    return replace(seen, stripe=points)


def see_again(record: ViewRecord, session: Session, belief: Belief) -> SeenView:
    """Detect in the pictures of a view that is on the disk.

    Raises:
        UnmeasurableError: no board.
        DocumentError: a picture cannot be read.
    """
    size = belief.sensor.camera.image_size
    return see_view(record, session.read_image(record.ring, size),
                    session.read_image(record.stripe, size), belief,
                    session.header.boards[record.place].board)
