"""What was seen of one hole: both pictures, and everything found in them or why it was refused."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.documents.result import Located
from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Image

WIDTH = 760           # px of each of the two panels
GAP, HEAD, FOOT = 16, 46, 118
CLOSEST = 1.9         # of the rim's half extent, shown around it
SUBPIXEL_BITS = 4
PAPER, INK, FAINT = (30, 26, 24), (236, 232, 228), (150, 146, 142)  # blue, green, red
GREEN, AMBER, CYAN, PINK, RED = ((110, 214, 90), (64, 176, 255), (240, 214, 90), (190, 120, 255),
                                 (86, 86, 255))
FONT = cv2.FONT_HERSHEY_DUPLEX


@dataclass(frozen=True)
class Panel:
    """A part of a picture, magnified by `scale`, its first pixel being `corner` (x, y)."""

    canvas: Image
    corner: Array
    scale: float

    def points(self, pixels: Array) -> Array:
        """Carry pixels (n, 2) onto the panel, in 1/16 px."""
        onto = (np.atleast_2d(pixels) - self.corner + 0.5) * self.scale - 0.5
        return np.rint(onto * 2**SUBPIXEL_BITS).astype(np.int32)

    def dots(self, pixels: Array, colour: tuple[int, int, int], radius: float) -> None:
        """Draw filled dots."""
        for point in self.points(pixels):
            cv2.circle(self.canvas, point.tolist(), round(radius * 2**SUBPIXEL_BITS), colour, -1,
                       cv2.LINE_AA, SUBPIXEL_BITS)

    def line(self, pixels: Array, colour: tuple[int, int, int], width: int = 1) -> None:
        """Draw a line through points."""
        cv2.polylines(self.canvas, [self.points(pixels)], isClosed=False, color=colour,
                      thickness=width, lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS)

    def name(self, text: str, pixel: Array, colour: tuple[int, int, int], side: int) -> None:
        """Write a name beside a point, to the right (+1) or the left (-1) of it."""
        x, y = (self.points(pixel)[0] / 2**SUBPIXEL_BITS).astype(int).tolist()
        (width, height), _ = cv2.getTextSize(text, FONT, 0.6, 1)
        left, low = x + 14 if side > 0 else x - 14 - width, y + height // 2
        cv2.rectangle(self.canvas, (left - 4, low - height - 4), (left + width + 4, low + 5),
                      PAPER, -1, cv2.LINE_AA)
        _write(self.canvas, text, (left, low), 0.6, colour)


def draw_pair(hole_image: Image, stripe_image: Image,
              outcome: Located | UnmeasurableError) -> bytes:
    """Draw both pictures side by side with what was found, or with the reason of the refusal.

    Returns:
        A PNG.
    """
    trace = outcome.trace if isinstance(outcome, Located) else {}
    corner, extent = _window(trace, hole_image.shape)
    height = round(WIDTH * extent[1] / extent[0])
    canvas = np.full((HEAD + height + FOOT, 2 * WIDTH + 3 * GAP, 3), PAPER, np.uint8)
    panels = [_place(canvas, image, corner, extent, (GAP + k * (WIDTH + GAP), HEAD))
              for k, image in enumerate((hole_image, stripe_image))]
    _write(canvas, "ring light: the hole", (GAP, 30), 0.68, INK)
    _write(canvas, "laser: the stripe", (2 * GAP + WIDTH, 30), 0.68, INK)
    if isinstance(outcome, Located):
        _draw_hole(panels[0], trace)
        _draw_stripe(panels[1], trace)
        _caption(canvas, outcome)
    else:
        _draw_refusal(canvas, outcome)
    return bytes(cv2.imencode(".png", canvas)[1].tobytes())


def _window(trace: dict[str, Array], shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Choose the part of the pictures to show: around the rim, or all."""
    whole = np.array(shape[1::-1], dtype=np.float64)
    if "ellipse" not in trace:
        return np.zeros(2), whole
    low, high = trace["ellipse"].min(axis=0), trace["ellipse"].max(axis=0)
    half = CLOSEST * float((high - low).max()) / 2.0 * np.array([1.0, 0.9])
    extent = np.minimum(2.0 * half, whole)
    corner = np.clip((low + high) / 2.0 - extent / 2.0, 0.0, whole - extent)
    return np.floor(corner), np.floor(extent)


def _place(canvas: Image, image: Image, corner: Array, extent: Array,
           place: tuple[int, int]) -> Panel:
    left, top = corner.astype(int)
    part = image[top:top + int(extent[1]), left:left + int(extent[0])]
    scale = WIDTH / part.shape[1]
    size = (WIDTH, round(part.shape[0] * scale))
    grey = cv2.resize(_stretched(part), size, interpolation=cv2.INTER_CUBIC)
    canvas[place[1]:place[1] + size[1], place[0]:place[0] + size[0]] = grey[..., None]
    shown = canvas[place[1]:place[1] + size[1], place[0]:place[0] + size[0]]
    return Panel(shown, corner, scale)


def _stretched(part: Image) -> Image:
    """Brighten a dark picture for the eye; a bright one stays as it is."""
    top = max(float(np.quantile(part, 0.995)), 1.0)
    return np.asarray(np.clip(part * max(1.0, 230.0 / top), 0, 255), dtype=np.uint8)


def _draw_hole(panel: Panel, trace: dict[str, Array]) -> None:
    panel.dots(trace["rim"], GREEN, 1.6)
    panel.line(trace["ellipse"], GREEN)
    if "chord" in trace:
        panel.line(trace["chord"], CYAN)
        _draw_chord(panel, trace)
    _draw_cross(panel, trace["centre"])
    panel.name("C", trace["centre"], PINK, +1)


def _draw_stripe(panel: Panel, trace: dict[str, Array]) -> None:
    panel.line(trace["ellipse"], GREEN)
    panel.dots(trace["stripe"], AMBER, 1.6)
    if "chord" in trace:
        panel.line(trace["chord"], CYAN)
        _draw_chord(panel, trace)


def _draw_chord(panel: Panel, trace: dict[str, Array]) -> None:
    ends = np.vstack([trace["chord"], trace["q"]])
    side = -1 if float(np.squeeze(trace["centre"])[0]) > float(np.squeeze(trace["q"])[0]) else +1
    panel.dots(ends, PAPER, 6.0)
    panel.dots(ends, CYAN, 4.5)
    for name, end in zip("ABQ", ends, strict=True):
        panel.name(name, end, CYAN, side)


def _draw_cross(panel: Panel, centre: Array) -> None:
    arm = 9.0 / panel.scale
    for direction in (np.array([arm, 0.0]), np.array([0.0, arm])):
        panel.line(np.stack([centre - direction, centre + direction]), PINK, 2)


def _caption(canvas: Image, located: Located) -> None:
    x, y, z = located.centre
    u = np.sqrt(np.diag(located.covariance))
    top = canvas.shape[0] - FOOT + 34
    _write(canvas, f"C = ({x:.4f}, {y:.4f}, {z:.4f}) mm     r = {located.radius:.4f} mm",
           (GAP, top), 0.78, INK)
    _write(canvas, f"u = ({u[0]:.4f}, {u[1]:.4f}, {u[2]:.4f}) mm     u(r) = {u[3]:.4f} mm     "
                   f"camera frame, k = 1, {located.method}", (GAP, top + 32), 0.6, FAINT)
    legend = (("rim", GREEN), ("stripe", AMBER), ("chord A-B, its midpoint Q", CYAN),
              ("centre C", PINK))
    left = GAP
    for text, colour in legend:
        cv2.circle(canvas, (left + 6, top + 58), 5, colour, -1, cv2.LINE_AA)
        _write(canvas, text, (left + 18, top + 64), 0.55, FAINT)
        left += 44 + cv2.getTextSize(text, FONT, 0.55, 1)[0][0]


def _draw_refusal(canvas: Image, refused: UnmeasurableError) -> None:
    top = canvas.shape[0] - FOOT + 38
    cv2.rectangle(canvas, (GAP, top - 26), (GAP + 6, top + 46), RED, -1)
    _write(canvas, f"refused: {refused.reason}", (GAP + 20, top), 0.85, RED)
    _write(canvas, refused.detail, (GAP + 20, top + 36), 0.6, INK)


def _write(canvas: Image, text: str, place: tuple[int, int], size: float,
           colour: tuple[int, int, int]) -> None:
    cv2.putText(canvas, text, place, FONT, size, colour, 1, cv2.LINE_AA)
