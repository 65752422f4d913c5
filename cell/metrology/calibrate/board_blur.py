"""How soft the camera draws a sharp edge, from the squares of a ChArUco board.

Measured as the locator measures a rim (the same smoothing, sampling and normal-distribution edge),
so that the two can be compared: it is the lens's blur together with a pixel's own width and that of
sampling between pixels, which make some 0.25 px² of its square. A print's own softness counts in.

A lens is sharp at one distance: the square of the blur is a parabola over the distance, and what
counts is its value at the working distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from scipy.special import ndtr

from cell.core.geometry import Array, Transform
from cell.core.observation import Image
from cell.metrology.arrays import Indices, Mask
from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.detect_board import SATURATED, BoardDesign
from cell.metrology.detect.band import SMOOTHING, sample_profiles, smooth, spread
from cell.metrology.detect.profile import Comparison, bell, explain, fit_levels
from cell.metrology.detect.profile_fit import NARROWEST, SETTLED, USUAL_BLUR, WIDEST
from cell.metrology.spread import middle, robust_sigma, tukey_weights

BOTH_WAYS = spread(4.0, 1.0)  # px across an edge
OFFSETS = BOTH_WAYS[:-1]  # from black to white: as far as across the rim of a thin sheet
PROFILES = 16       # across each edge
CORNER = 8.0        # px from a corner, beyond which its blur is not seen
BORDER = 7.0        # px from the image's border
NARROWEST_GAP = 5.0  # px of white between an edge and the marker beside it
SHORTEST = 8.0      # px of an edge between its corners' blur
STEPS = 10
CLEAR = 20.0        # times what profiles leave unexplained, that a step has to be high
LEVEL = 0.02        # of the distance: edges so near to a view's own distance speak for it
FEWEST_EDGES, FEWEST_VIEWS = 6, 3
FOR_A_PARABOLA, EACH_SIDE = 6, 2  # views, of them nearer and farther than the distance
AGREES = 0.03       # of the square, by which views that agree may differ
DRAWS = 2000        # curves to choose from


@dataclass(frozen=True, eq=False)
class SeenEdges:
    """Edges between black and white squares in one view: where on the board their middles are
    (k, 3) mm, the `grey` (k, PROFILES, m) of a smoothed picture across them at OFFSETS, from black
    to white, and how wide the white is (k,) px, up to the black of the marker in it.
    """

    places: Array
    grey: Array
    gaps: Array

    def __getitem__(self, which: Mask) -> SeenEdges:
        """Return some of the edges."""
        return SeenEdges(self.places[which], self.grey[which], self.gaps[which])


@dataclass(frozen=True, eq=False)
class LensBlur:
    """How soft a sharp edge appears at a `distance` (mm): `value`, the standard deviation in px;
    `misses` (n,) px are what each view differs by from what all say of its own distance.
    """

    value: float
    misses: Array
    distance: float

    @property
    def spread(self) -> float:
        """How far the views differ (px, rms): a focus that drifts, a lens that was touched."""
        return float(np.sqrt(np.mean(self.misses**2)))

    def __str__(self) -> str:
        return (f"a sharp edge is {self.value:.3f} px soft (standard deviation) at "
                f"{self.distance:.0f} mm, spread over {len(self.misses)} views {self.spread:.3f} "
                "px: a hole's rim that is notably softer counts as rounded or burred, and its "
                "radius as less certain")


def find_edges(image: Image, view: BoardView, design: BoardDesign) -> SeenEdges:
    """Find the edges between the corners that were seen, and sample profiles across their middle
    parts: away from corners and the image's border, and not overexposed.
    """
    ends = _neighbours(view, design)
    feet, normals = _lay_profiles(view.pixels[ends])
    gaps = _gaps(view, ends, design)
    kept = _inside(image, feet) & (gaps > NARROWEST_GAP)
    if not kept.any():
        return SeenEdges(np.empty((0, 3)), np.empty((0, PROFILES, len(OFFSETS))), np.empty(0))
    grey = sample_profiles(smooth(image, np.zeros(2)), feet[kept].reshape(-1, 2),
                           np.repeat(normals[kept], PROFILES, axis=0), BOTH_WAYS)
    edges = SeenEdges(view.points_in_board[ends[kept]].mean(axis=1),
                      _from_black(grey.reshape(-1, PROFILES, len(BOTH_WAYS))), gaps[kept])
    return edges[edges.grey.max(axis=(1, 2)) < SATURATED]


def solve_lens_blur(seen: Sequence[SeenEdges | None], camera_from_board: Sequence[Transform],
                    distance: float) -> LensBlur | None:
    """Say how soft a sharp edge appears at a distance (mm), from the edges of several views.

    A view speaks by the edges that are as far away as the board where the optic axis meets it. The
    views that agree count: one that shook is softer than others at its distance. Where the views do
    not lie about the distance, those that are nearest to it speak for it.

    Returns:
        None where too few views show enough edges.
    """
    found = [_blur_of_view(edges, pose)
             for edges, pose in zip(seen, camera_from_board, strict=True) if edges is not None]
    told = np.array([view for view in found if view is not None]).reshape(-1, 2)
    if len(told) < FEWEST_VIEWS:
        return None
    off, squares = told[:, 0] / distance - 1.0, told[:, 1]
    if len(told) >= FOR_A_PARABOLA and min((off <= 0.0).sum(), (off >= 0.0).sum()) >= EACH_SIDE:
        curve = np.stack([np.ones_like(off), off, off**2], axis=1)
    else:
        nearest = np.argsort(np.abs(off))[:FEWEST_VIEWS]
        distance, squares = float(told[nearest, 0].mean()), squares[nearest]
        curve = np.ones((len(nearest), 1))
    fitted = _agree(curve, squares)
    misses = _root(squares) - _root(curve @ fitted)
    return LensBlur(float(_root(fitted[0])), misses, distance)


def _neighbours(view: BoardView, design: BoardDesign) -> Indices:
    """Pair the corners (k, 2) that are one square apart, by their numbers in the view."""
    place = np.rint(view.points_in_board[:, :2] / design.square_mm).astype(np.intp)
    number = np.full(np.array(design.squares) + 1, -1)
    number[tuple(place.T)] = np.arange(len(place))
    pairs = np.concatenate([
        np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
        np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)])
    return pairs[(pairs >= 0).all(axis=1)]


def _gaps(view: BoardView, ends: Indices, design: BoardDesign) -> Array:
    """Give how wide (k,) px the white is between edges and the markers beside them."""
    to_pixels = cv2.findHomography(view.points_in_board[:, :2], view.pixels)[0]
    corners, pixels = view.points_in_board[ends][..., :2], view.pixels[ends]
    aside = _normals(corners) * (design.square_mm - design.marker_mm)  # half of it to either side
    middles = corners.mean(axis=1)
    one, other = (_carry(to_pixels, middles + half) for half in (aside / 2.0, -aside / 2.0))
    return np.asarray(np.abs(np.sum((one - other) * _normals(pixels), axis=1)) / 2.0)


def _carry(homography: Array, points: Array) -> Array:
    carried = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return np.asarray(carried[:, :2] / carried[:, 2:])


def _normals(ends: Array) -> Array:
    """Give the unit normals (k, 2) of lines through two points each (k, 2, 2)."""
    along = ends[:, 1] - ends[:, 0]
    return np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]


def _lay_profiles(ends: Array) -> tuple[Array, Array]:
    """Lay profiles across the middle parts of edges (k, 2, 2) px that are long enough: their feet
    (k, PROFILES, 2), not numbers where they are not, and normals (k, 2).
    """
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    reach = np.where(length > 2.0 * CORNER + SHORTEST, 0.5 - CORNER / length, np.nan)
    share = 0.5 + np.linspace(-1.0, 1.0, PROFILES) * reach[:, None]
    return ends[:, :1] + share[..., None] * along[:, None], _normals(ends)


def _inside(image: Image, feet: Array) -> Mask:
    """Tell which edges (k,) have all their profiles within the image."""
    last = np.array(image.shape[::-1]) - 1.0 - BORDER
    return np.asarray(((feet >= BORDER) & (feet <= last)).all(axis=(1, 2)))


def _from_black(grey: Array) -> Array:
    """Turn profiles (k, PROFILES, m + 1) round that run from white to black: (k, PROFILES, m)."""
    half = len(BOTH_WAYS) // 2
    falls = grey[..., :half].sum(axis=(1, 2)) > grey[..., -half:].sum(axis=(1, 2))
    return np.where(falls[:, None, None], grey[..., ::-1], grey)[..., :len(OFFSETS)]


def _blur_of_view(edges: SeenEdges, camera_from_board: Transform) -> tuple[float, float] | None:
    """Give a view's distance (mm) and the square of its blur (px²); None for too few edges."""
    toward = camera_from_board.rotation[:, 2]
    distance = float(toward @ camera_from_board.translation / toward[2])
    depths = (camera_from_board @ edges.places)[:, 2]
    level = np.abs(depths - distance) < LEVEL * distance
    if level.sum() < FEWEST_EDGES:
        return None
    square = _fit_square(edges[level])
    return None if square is None else (distance, square)


def _fit_square(edges: SeenEdges) -> float | None:
    """Fit the square of the blur (px²) that edges share, each profile with a place of its own; None
    where they are no clear steps.
    """
    grey, gap = edges.grey.reshape(-1, len(OFFSETS)), np.repeat(edges.gaps, PROFILES)
    places, blur = np.zeros(len(grey)), USUAL_BLUR
    for _ in range(STEPS):
        seen = _against_step(grey, gap, places, blur)
        stiff = np.maximum(seen.products[:, 0, 0], 1e-9)
        tie = seen.products[:, 0, 1] / stiff  # the edges may move along
        weight = tukey_weights(np.maximum(seen.misfit - middle(seen.misfit), 0.0), _scale(seen))
        pull = weight @ (seen.pulls[:, 1] - tie * seen.pulls[:, 0])
        square = float(weight @ (seen.products[:, 1, 1] - tie * seen.products[:, 0, 1]))
        move = float(pull) / max(square, 1e-9)
        places = places + np.clip(seen.pulls[:, 0] / stiff - tie * move, -0.5, 0.5)
        blur = float(np.clip(blur + np.clip(move, -0.5, 0.5), NARROWEST, WIDEST))
        if abs(move) < SETTLED / 10.0:
            break
    seen = _against_step(grey, gap, places, blur)
    return blur**2 - SMOOTHING**2 if middle(seen.levels[:, 1]) > CLEAR * _scale(seen) else None


def _against_step(grey: Array, gap: Array, places: Array, blur: float) -> Comparison:
    """Compare profiles (n, m) with black, white from `places` (n,) px on, and a marker's black
    `gap` (n,) px further: its blur reaches into the profile.
    """
    near, far = ((OFFSETS - at[:, None]) / blur for at in (places, places + gap))
    signals = np.empty((len(grey), 5, len(OFFSETS)))
    signals[:, 2], signals[:, 3], signals[:, 4] = 1.0, ndtr(near) - ndtr(far), grey
    levels = fit_levels(signals[:, 2:])
    steep = levels[:, 1, None] / blur
    signals[:, 0] = steep * (bell(far) - bell(near))
    signals[:, 1] = steep * (bell(far) * far - bell(near) * near)
    return explain(signals, levels)


def _scale(seen: Comparison) -> float:
    return max(middle(seen.misfit), 1e-3)


def _agree(curve: Array, squares: Array) -> Array:
    """Fit a curve (n, p) to the squares (n,) of the views that agree: of the curves through p views
    each the one that most views lie near, then Tukey's biweight about it.
    """
    near = AGREES * middle(squares)
    draws = np.array([*combinations(range(len(squares)), curve.shape[1])])
    draws = draws[::1 + len(draws) // DRAWS]
    drawn = np.einsum("dpq,dq->dp", np.linalg.pinv(curve[draws]), squares[draws])
    convex = drawn[:, -1] >= 0.0  # a lens is softer on either side of where it is sharp
    drawn = drawn[convex] if convex.any() else drawn
    fitted = drawn[np.argmin(np.minimum(np.abs(drawn @ curve.T - squares), near).sum(axis=1))]
    for _ in range(STEPS):
        miss = squares - curve @ fitted
        root = np.sqrt(tukey_weights(miss, max(robust_sigma(miss), near / 3.0)))
        fitted = np.linalg.lstsq(curve * root[:, None], squares * root)[0]
    return np.asarray(fitted)


def _root(squares: Array | float) -> Array:
    return np.asarray(np.sqrt(np.maximum(squares, 1e-6)))
