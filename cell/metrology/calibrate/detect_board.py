"""Find the corners of a ChArUco board in a picture, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Image
from cell.metrology.calibrate.board_pose import BoardView

FEWEST_CORNERS = 12
SATURATED = 254


@dataclass(frozen=True)
class BoardDesign:
    """A ChArUco board: `squares` (columns, rows), their side and that of the markers in mm."""

    squares: tuple[int, int]
    square_mm: float
    marker_mm: float
    dictionary: str = "DICT_4X4_100"

    @property
    def corners(self) -> int:
        """How many inner corners it has."""
        return (self.squares[0] - 1) * (self.squares[1] - 1)

    @property
    def middle(self) -> Array:
        """The middle (3,) of the board in its own frame: origin at the first outer corner."""
        return np.array([*self.squares, 0.0]) * self.square_mm / 2.0

    @property
    def outline(self) -> Array:
        """The four outer corners (4, 3)."""
        wide, high = np.array(self.squares) * self.square_mm
        return np.array([[0, 0, 0], [wide, 0, 0], [wide, high, 0], [0, high, 0]], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class SeenBoard:
    """The corners found, and what an operator wants to know of the picture.

    `sharpness` is the mean gradient at the corners over their contrast (1/px: some 0.4 in focus),
    `exposure` is `ok`, `dark` or `bright`, `cut_off` names the image edges the board runs over.
    """

    view: BoardView
    sharpness: float
    exposure: str
    cut_off: tuple[str, ...]


def detect_board(image: Image, design: BoardDesign) -> SeenBoard:
    """Locate the inner corners of a board.

    Raises:
        UnmeasurableError: `no_board` with what to do: exposure, focus or the edge that is cut off.
    """
    corners, ids = _detect(image, design)
    exposure = _exposure(image)
    if len(ids) < FEWEST_CORNERS:
        raise UnmeasurableError("no_board", f"{len(ids)} of {design.corners} corners seen"
                                            f"{_advice(corners, image, exposure)}")
    points = np.asarray(_board(design).getChessboardCorners(), dtype=np.float64)[ids]
    view = BoardView(points, corners.astype(np.float64))
    return SeenBoard(view, _sharpness(image, corners), exposure, _cut_off(corners, image, design))


def _board(design: BoardDesign) -> cv2.aruco.CharucoBoard:
    marks = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, design.dictionary))
    return cv2.aruco.CharucoBoard(design.squares, design.square_mm, design.marker_mm, marks)


def _detect(image: Image, design: BoardDesign) -> tuple[Array, Array]:
    detector = cv2.aruco.CharucoDetector(_board(design))
    corners, ids, _, _ = detector.detectBoard(image)
    if ids is None:
        return np.empty((0, 2)), np.empty(0, dtype=np.intp)
    return corners.reshape(-1, 2), ids.ravel()


def _exposure(image: Image) -> str:
    if float(np.mean(image >= SATURATED)) > 0.02:
        return "bright"
    return "dark" if float(np.percentile(image, 98)) < 60.0 else "ok"


def _sharpness(image: Image, corners: Array) -> float:
    """The steepest gradient near each corner, over the contrast there: the median corner."""
    values = []
    for x, y in np.rint(corners).astype(int):
        patch = image[max(0, y - 7):y + 8, max(0, x - 7):x + 8].astype(np.float64)
        contrast = float(np.ptp(patch))
        slopes = np.hypot(*np.gradient(patch))
        values.append(float(np.percentile(slopes, 98)) / max(contrast, 1.0))
    return float(np.median(values))


def _cut_off(corners: Array, image: Image, design: BoardDesign) -> tuple[str, ...]:
    """Name the edges of the image next to which corners are missing."""
    if len(corners) == design.corners:
        return ()
    height, width = image.shape
    reach = 1.5 * float(np.sqrt(np.prod(np.ptp(corners, axis=0)) / max(1, len(corners))))
    near = {"left": corners[:, 0].min() < reach, "right": corners[:, 0].max() > width - reach,
            "upper": corners[:, 1].min() < reach, "lower": corners[:, 1].max() > height - reach}
    return tuple(edge for edge, is_near in near.items() if is_near)


def _advice(corners: Array, image: Image, exposure: str) -> str:
    if exposure != "ok":
        return f": the picture is too {exposure}"
    if len(corners) == 0:
        return ": is the board in view, in focus, and the one that was named?"
    height, width = image.shape
    middle = corners.mean(axis=0) / [width, height]
    off = {"left": middle[0] < 0.35, "right": middle[0] > 0.65,
           "upper": middle[1] < 0.35, "lower": middle[1] > 0.65}
    edges = [edge for edge, is_off in off.items() if is_off]
    return f": it is cut off at the {' and '.join(edges)} edge" if edges else ": is it covered?"
