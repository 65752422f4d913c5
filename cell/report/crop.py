"""Cut-outs of the camera's pictures around a hole, with what was found drawn on them."""

from __future__ import annotations

import base64

import cv2
import numpy as np

from cell.core.documents.result import Located
from cell.core.geometry import Array
from cell.core.observation import Image

SHOWN = 420  # px that a crop is wide on the page, at least
MARGIN = 1.6  # of the rim's half extent
GREEN, ORANGE, CYAN, WHITE = (80, 220, 80), (60, 150, 255), (255, 220, 60), (255, 255, 255)
SUBPIXEL_BITS = 4


def draw_crop(image: Image, located: Located | None) -> str:
    """Draw the neighbourhood of the hole and return it as a data address for a page.

    Without `located` (a refused hole) the whole picture is shown, half size.
    """
    if located is None or "ellipse" not in located.trace:
        small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        return _as_data(cv2.cvtColor(small, cv2.COLOR_GRAY2BGR))
    left, top, right, bottom = _window(located.trace["ellipse"], image.shape)
    cut = cv2.cvtColor(np.ascontiguousarray(image[top:bottom, left:right]), cv2.COLOR_GRAY2BGR)
    scale = max(1, -(-SHOWN // (right - left)))
    picture = cv2.resize(cut, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    _draw_trace(picture, located.trace, np.array([left, top], dtype=np.float64), scale)
    return _as_data(picture)


def _window(ellipse: Array, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    low, high = ellipse.min(axis=0), ellipse.max(axis=0)
    middle, half = (low + high) / 2.0, float((high - low).max()) / 2.0 * MARGIN
    left, top = np.maximum(np.floor(middle - half), 0).astype(int)
    right, bottom = np.minimum(np.ceil(middle + half), [shape[1], shape[0]]).astype(int)
    return int(left), int(top), int(right), int(bottom)


def _draw_trace(picture: Array | Image, trace: dict[str, Array], corner: Array,
                scale: int) -> None:
    def place(points: Array) -> Array:
        magnified = (np.atleast_2d(points) - corner + 0.5) * scale - 0.5
        return np.round(magnified * 2**SUBPIXEL_BITS).astype(np.int32)

    cv2.polylines(picture, [place(trace["ellipse"])], isClosed=True, color=GREEN, thickness=1,
                  lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS)
    for name, colour, radius in (("stripe", ORANGE, 1), ("chord", CYAN, 4), ("q", CYAN, 3),
                                 ("centre", WHITE, 5)):
        for point in place(trace[name]) if name in trace else ():
            cv2.circle(picture, point.tolist(), radius * 2**SUBPIXEL_BITS, colour, 1,
                       cv2.LINE_AA, SUBPIXEL_BITS)


def _as_data(picture: Array | Image) -> str:
    whole, blob = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
    if not whole:
        raise ValueError("the picture cannot be encoded")
    return "data:image/jpeg;base64," + base64.b64encode(blob.tobytes()).decode()
