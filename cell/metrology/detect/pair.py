"""Find hole and stripe together: the hole to be measured is the one that the stripe crosses."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.observation import Image
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.detect.find_holes import LIT, Hole, find_holes
from cell.metrology.detect.gates import COMPLETE, check_lit, is_white, why_no_hole
from cell.metrology.detect.hole import detect_rim
from cell.metrology.detect.lit_rim import find_lit_rim
from cell.metrology.detect.opening import LEAST_GAP, name_opening
from cell.metrology.detect.ridge import Ridge, find_ridges, ground_along, runs_upright, shows_in
from cell.metrology.detect.stripe import crosses, ends_at, falls_into, follow_stripe, gaps, outline
from cell.metrology.features import Expected, Rim, Stripe
from cell.metrology.reasons import Reason, refusal
from cell.metrology.spread import middle

DOUBTFUL = ("slot", "half_occluded", "not_round", "hole_cut_by_border", "too_dark")
FAINT = 0.2       # of the contrast of another hole in the same picture
CLEAR, ALIKE = 3.0, 0.4  # times its ground: no scratch; of that in one image, in the other
STRAIGHT_AGAIN = 12.0  # px beside a rim, die roll included
SURE, MOST = 0.9, 2  # coverage, beyond which nothing is missing; gaps of the stripe
ALIKE_SIZE = 0.1  # of a radius
ANYWHERE = 100.0  # mm, the standard deviation of where a hole may be in the picture


def detect_pair(hole_image: Image, stripe_image: Image, sensor: SensorModel,
                expected: Expected) -> tuple[Rim, Stripe]:
    """Find the rim of the hole that the stripe crosses, and the stripe on both its sides.

    Raises:
        UnmeasurableError: with one of the documented reasons.
    """
    upright = runs_upright(sensor.light_plane)
    ridges = find_ridges(stripe_image, upright=upright)
    if _brighter(stripe_image, hole_image) and find_ridges(hole_image, upright=upright):
        raise refusal("images_swapped")
    ridges = [ridge for ridge in ridges if not _is_scratch(ridge, stripe_image, hole_image)]
    if not ridges:
        raise refusal("no_laser")
    check_lit(hole_image)
    ridge, rim = _choose(ridges, hole_image, sensor, expected)
    return rim, follow_stripe(stripe_image, ridge, rim, sensor, expected)


def _detect_rim(image: Image, hole: Hole, ridge: Ridge, camera: CameraModel,
                expected: Expected) -> Rim:
    """Locate the rim of a hole. Where its size is unknown, anything may have been taken for a rim:
    then the opening's outline tells better why it is none.
    """
    try:
        return detect_rim(image, hole, camera, expected)
    except UnmeasurableError as refused:
        by_rim = expected.radius is not None or refused.reason not in DOUBTFUL
        reason = None if by_rim else name_opening(image, ridge)
        if reason is None:
            raise
        raise refusal(reason) from refused


def _choose(ridges: list[Ridge], image: Image, sensor: SensorModel,
            expected: Expected) -> tuple[Ridge, Rim]:
    """Choose the stripe on the sheet, and the hole that it crosses, and locate its rim."""
    reasons: list[Reason] = []
    for ridge in ridges:
        placed = _at_depth(expected, ridge, sensor)
        hole, beside = _crossed(find_holes(image, sensor.camera, placed), ridge)
        if hole is None or hole.inside > 0 or (hole.coverage < SURE and hole.glow > LIT):
            lit = _before_something_lit(image, ridge, sensor.camera, placed)
            if lit is not None:
                return ridge, lit
        if hole is not None:
            if hole.coverage < COMPLETE:
                _check_radius(ridge, image, sensor, expected)
            return ridge, _detect_rim(image, hole, ridge, sensor.camera, placed)
        hidden = is_white(image) and ridge.gone.sum() >= LEAST_GAP
        reasons.append("laser_misses_hole" if beside and not hidden else why_no_hole(image, ridge))
    _check_radius(ridges[0], image, sensor, expected)
    raise refusal(reasons[0])


def _before_something_lit(image: Image, ridge: Ridge, camera: CameraModel,
                          expected: Expected) -> Rim | None:
    """Locate a rim where the stripe leaves the sheet and comes back; None where none is clear."""
    for ends in gaps(ridge, LEAST_GAP)[:MOST]:
        hole = find_lit_rim(image, ends, camera, expected)
        if hole is not None:
            with suppress(UnmeasurableError):
                rim = detect_rim(image, hole, camera, expected)
                ellipse = outline(rim)
                if np.abs(ellipse.reach(ends) - 1.0).max() * ellipse.radius < STRAIGHT_AGAIN:
                    return rim
    return None


def _check_radius(ridge: Ridge, image: Image, sensor: SensorModel, expected: Expected) -> None:
    """Refuse a pair whose hole is whole, but of quite another size than expected."""
    if expected.radius is None:
        return
    placed = replace(_at_depth(expected, ridge, sensor), radius=None)
    hole, _ = _crossed(find_holes(image, sensor.camera, placed), ridge)
    if hole is not None and hole.coverage > COMPLETE and placed.centre is not None:
        radius = hole.ellipse.radius * placed.centre[2] / sensor.camera.matrix[0, 0]
        if abs(radius - expected.radius) < ALIKE_SIZE * expected.radius:
            return
        raise refusal("radius_against_nominal",
                      f"about {radius:.1f} mm instead of {expected.radius:.1f}")


def _is_scratch(ridge: Ridge, stripe_image: Image, hole_image: Image) -> bool:
    """Tell whether a ridge is no laser but a scratch: no brighter against its ground than in the
    hole image, where it shows as well.
    """
    clearness = ridge.height / ground_along(ridge, stripe_image)
    return clearness < CLEAR and shows_in(ridge, hole_image) > ALIKE * clearness


def _brighter(image: Image, other: Image) -> bool:
    return middle(image[::8, ::8].ravel()) > middle(other[::8, ::8].ravel())


def _at_depth(expected: Expected, ridge: Ridge, sensor: SensorModel) -> Expected:
    """Add how far away the sheet is, which the stripe tells, where nothing else does."""
    if expected.centre is not None:
        return expected
    some = ridge.points(ridge.length)[::16]
    on_sheet = sensor.light_plane.meet(sensor.camera.rays(some))
    return replace(expected, centre=np.median(on_sheet, axis=0), centre_sigma=ANYWHERE)


def _crossed(holes: Iterable[Hole], ridge: Ridge) -> tuple[Hole | None, bool]:
    """Choose the hole that the stripe crosses: the first whole one, else the most complete. Tells
    also whether there was a whole one anywhere.
    """
    crossed: Hole | None = None
    strongest = 0.0  # contrast of the whole holes beside the stripe: an odd arc is much weaker
    for hole in holes:
        whole = hole.coverage > COMPLETE
        if not crosses(ridge, hole.ellipse):
            strongest = max(strongest, hole.contrast if whole else 0.0)
        elif (hole.contrast < FAINT * strongest or not falls_into(ridge, hole.ellipse)
              or not ends_at(ridge, hole.ellipse, STRAIGHT_AGAIN, both=hole.inside > 0)):
            continue
        elif whole:
            return hole, True
        elif crossed is None or hole.coverage > crossed.coverage:
            crossed = hole
    if crossed is None or crossed.contrast < FAINT * strongest:
        return None, strongest > 0.0
    return crossed, True

