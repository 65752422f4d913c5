"""Find the laser stripe on the sheet, on both sides of the hole, to a fraction of a pixel."""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Plane
from cell.core.observation import Image
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.detect.ellipse import Ellipse
from cell.metrology.detect.ridge import BIN, Ridge, find_ridges, runs_upright
from cell.metrology.detect.stripe_centres import HALF_WINDOW, centre_stripe
from cell.metrology.features import Expected, Rim, Stripe
from cell.metrology.reasons import refusal
from cell.metrology.spread import correlation_length, middle, robust_sigma, tukey_weights

DIE_ROLL = 0.7      # mm beside the rim, where a sheet of unknown thickness bends into the hole
LENGTH = 12.0       # mm of stripe used on either side: the sheet is flat as far as that
LARGEST_GAP = 0.4   # px between the two sides, beyond what their noise allows
LEAST_LINES = 8     # on either side
HALF = 0.5          # of its usual height, at which a stripe ends
DEEP = 0.95         # of the radius, from which on a stripe counts as inside
LEAST_GAP = 0.3     # of the chord, on which the stripe has to be gone


def detect_stripe(image: Image, rim: Rim, camera: CameraModel, light_plane: Plane,
                  expected: Expected) -> Stripe:
    """Locate the stripe on the sheet beside a hole that is known; it need not cross it.

    Raises:
        UnmeasurableError: there is no stripe, too little of it, or its two sides disagree.
    """
    ridges = find_ridges(image, upright=runs_upright(light_plane))
    if not ridges:
        raise refusal("no_laser")
    hole = outline(rim)
    ridge = next((ridge for ridge in ridges if falls_into(ridge, hole)), ridges[0])
    return follow_stripe(image, ridge, rim, SensorModel(camera, light_plane), expected)


def follow_stripe(image: Image, ridge: Ridge, rim: Rim, sensor: SensorModel,
                  expected: Expected) -> Stripe:
    """Locate a stripe that was found as a whole, line by line."""
    hole = outline(rim)
    v, side = _lines_beside(image, ridge, hole, _reaches(ridge, hole, sensor, expected))
    _check_length(side)
    u, height = centre_stripe(image, ridge, v)
    bright = height > 0.3 * middle(height)
    points, side = ridge.pixels(u[bright], v[bright]), side[bright]
    _check_length(side)
    miss, scale = _straightness(points, sensor.camera, ridge.upright)
    good = np.abs(miss) < 3.5 * scale
    if _shorter(side[good]) < LEAST_LINES:
        raise refusal("stripe_segments_disagree", "they lie on no common line")
    sigma, correlation = robust_sigma(miss[good]), correlation_length(miss[good])
    gap, unsure = _gap(points[good][:, 1 if ridge.upright else 0], miss[good], side[good])
    if abs(gap) > LARGEST_GAP + 3.5 * unsure:
        raise refusal("stripe_segments_disagree", f"they are {gap:.1f} px apart")
    return Stripe(points=points[good], side=side[good], sigma=sigma, correlation=correlation,
                  quality={"height": ridge.height, "gap_px": gap, "share": ridge.share})


def _check_length(side: Array) -> None:
    if _shorter(side) < LEAST_LINES:
        raise refusal("stripe_too_short")


def _shorter(side: Array) -> int:
    """Count the lines of the side that has fewer."""
    return int(min((side < 0).sum(), (side > 0).sum()))


def _gap(along: Array, miss: Array, side: Array) -> tuple[float, float]:
    """Compare the two sides where they would meet: the distance, and its standard deviation."""
    middle = (along[side < 0].max() + along[side > 0].min()) / 2.0
    ends, variance = [], 0.0
    for chosen in (side < 0, side > 0):
        rows = np.column_stack([np.ones(chosen.sum()), along[chosen] - middle])
        inverse = np.linalg.inv(rows.T @ rows)
        line = inverse @ rows.T @ miss[chosen]
        rest = miss[chosen] - rows @ line
        ends.append(float(line[0]))
        variance += float(inverse[0, 0]) * robust_sigma(rest) ** 2 * correlation_length(rest)
    return ends[1] - ends[0], float(np.sqrt(variance))


def crosses(ridge: Ridge, hole: Ellipse) -> bool:
    """Tell whether the stripe passes through an ellipse."""
    return bool((hole.reach(ridge.points(ridge.length)) < DEEP).any())


def falls_into(ridge: Ridge, hole: Ellipse) -> bool:
    """Tell whether the stripe leaves the sheet inside an ellipse, as it does over a hole."""
    inside = hole.reach(ridge.points(ridge.length)) < DEEP
    return bool(inside.any()) and float(ridge.gone[inside].mean()) > LEAST_GAP


def ends_at(ridge: Ridge, hole: Ellipse, reach: float, *, both: bool = False) -> bool:
    """Tell whether the stripe is back on the sheet within `reach` px of an ellipse that it crosses,
    at one end at least or at `both`: beside a spot on something behind the hole, it is not.
    """
    v = np.flatnonzero(hole.reach(ridge.points(ridge.length)) < 1.0)
    span, there = int(reach), ~ridge.gone
    if not len(v):
        return False
    ends = there[max(v[0] - span, 0):v[0] + 1].any(), there[v[-1]:v[-1] + span + 1].any()
    return all(ends) if both else any(ends)


def gaps(ridge: Ridge, least: int) -> list[Array]:
    """List where a stripe leaves the sheet and comes back: pixels (2, 2), the longest gap first."""
    high = ridge.strength - HALF
    turns = np.flatnonzero(np.diff(np.signbit(high)))
    v = BIN * (turns + high[turns] / (high[turns] - high[turns + 1]) + 0.5) - 0.5
    falls = np.flatnonzero(high[turns] >= 0.0)  # the stripe leaves there
    ends = [v[fall:fall + 2] for fall in falls if fall + 1 < len(v)]
    long = [pair for pair in ends if pair[1] - pair[0] >= least]
    long.sort(key=lambda pair: float(pair[0] - pair[1]))
    return [ridge.pixels(ridge.across(pair), pair) for pair in long]


def outline(rim: Rim) -> Ellipse:
    """Give the ellipse of a rim."""
    x, y, major, minor, angle = rim.ellipse
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return Ellipse(np.array([x, y]), turn @ np.diag([major, minor]) @ turn.T)


def _reaches(ridge: Ridge, hole: Ellipse, sensor: SensorModel,
             expected: Expected) -> tuple[float, float]:
    """Say how far from the rim the stripe is used: from the end of the die roll, px, and up to."""
    die_roll = DIE_ROLL if expected.thickness is None else np.clip(expected.thickness / 2, 0.5, 1.0)
    along = hole.centre[1 if ridge.upright else 0]
    place = ridge.pixels(ridge.across(np.array([along])), np.array([along]))
    depth = float(sensor.light_plane.meet(sensor.camera.rays(place))[0, 2])
    scale = float(sensor.camera.matrix[0, 0]) / depth
    return max(float(die_roll) * scale, 4.0), max(LENGTH * scale, hole.radius)


def _lines_beside(image: Image, ridge: Ridge, hole: Ellipse,
                  reaches: tuple[float, float]) -> tuple[Array, Array]:
    """Choose the lines v on either side of the hole, and say which side (-1, +1) each is on."""
    length, width = image.shape if ridge.upright else image.shape[::-1]
    v = np.arange(length, dtype=np.float64)
    reach = hole.reach(ridge.points(length))
    inside = v[reach < max(1.0, float(reach.min()) + 1e-9)]  # or the line that comes nearest
    beyond = np.maximum(inside[0] - v, v - inside[-1])
    clear = (reach - 1.0) * hole.radius > reaches[0]
    u = ridge.across(v)
    seen = (u > HALF_WINDOW + 1) & (u < width - HALF_WINDOW - 2)
    use = clear & seen & (beyond < reaches[1])
    return v[use], np.where(v[use] < inside[0], -1.0, 1.0)


def _straightness(points: Array, camera: CameraModel, upright: bool) -> tuple[Array, float]:
    """Measure how far points lie from their common line, undistorted; px, and the spread."""
    across, along = camera.normalise(points).T[::1 if upright else -1]
    focal = float(camera.matrix[0, 0] if upright else camera.matrix[1, 1])
    rows = np.column_stack([np.ones_like(along), along])
    miss, scale = across - middle(across), 1.0
    for _ in range(5):
        scale = max(1e-3 / focal, robust_sigma(miss))
        weighed = (rows * tukey_weights(miss, scale)[:, None]).T
        miss = across - rows @ np.linalg.solve(weighed @ rows, weighed @ across)
    return miss * focal, scale * focal
