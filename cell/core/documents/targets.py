"""`targets.yaml`: the calibration targets of a cell, and roughly where they stand."""

from __future__ import annotations

import numpy as np

from cell.core.documents.base import Document, Matrix4, Vector3
from cell.core.documents.station import Positive
from cell.core.geometry import Transform


class BoardDocument(Document):
    """A ChArUco board: `squares` (columns, rows); `certificate` says who measured the squares.

    `base_from_board` is where it stands to a few centimetres: origin at its first outer corner, x
    along the columns, y down the rows, z into the board.
    """

    id: str
    squares: tuple[int, int]
    square_mm: Positive
    marker_mm: Positive
    dictionary: str = "DICT_4X4_100"
    certificate: str | None = None
    certified_until: str | None = None
    base_from_board: Matrix4

    @property
    def rough_place(self) -> Transform:
        """Where it stands, to a few centimetres."""
        return Transform(np.array(self.base_from_board))


class SphereDocument(Document):
    """A sphere of known radius, and where its centre is to a centimetre, in the base frame."""

    id: str
    radius_mm: Positive
    centre: Vector3
    certificate: str | None = None


class TargetsDocument(Document):
    """All targets of a cell."""

    boards: tuple[BoardDocument, ...]
    spheres: tuple[SphereDocument, ...] = ()
