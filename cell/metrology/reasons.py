"""Why a pair of images carries no measurement: every code that may stand in a result.

The codes are a contract: they appear in `cell locate --json`, in recordings and in reports.
"""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

from cell.core.errors import UnmeasurableError

Reason: TypeAlias = Literal[
    "no_hole", "no_laser", "laser_misses_hole", "slot", "not_round", "half_occluded",
    "hole_cut_by_border", "too_dark", "saturated", "blurred", "images_swapped",
    "stripe_segments_disagree", "stripe_too_short", "radius_against_nominal",
    "tilt_against_nominal", "arm_moved"]

REASONS: dict[Reason, str] = {
    "no_hole": "no round edge stands out from the surface in the ring-light image",
    "no_laser": "no laser stripe was found in the stripe image",
    "laser_misses_hole": "the laser stripe passes beside the hole",
    "slot": "the opening is longer than wide: a slot, not a round hole",
    "not_round": "the edge of the opening does not follow an ellipse",
    "half_occluded": "something covers a part of the hole",
    "hole_cut_by_border": "the hole reaches beyond the image",
    "too_dark": "the image is too dark to tell metal from hole",
    "saturated": "the image is saturated where the edge or the stripe should be",
    "blurred": "the edge is too blurred: the sensor is out of focus or was moving",
    "images_swapped": "the stripe lies in the hole image: the two images are swapped",
    "stripe_segments_disagree": "the stripe left and right of the hole is not one straight line",
    "stripe_too_short": "too little of the stripe lies on the sheet on one side of the hole",
    "radius_against_nominal": "the radius contradicts the nominal",
    "tilt_against_nominal": "the tilt of the sheet contradicts the nominal",
    "arm_moved": "the arm moved between the two exposures",
}

if set(REASONS) != set(get_args(Reason)):  # the one table must stay whole
    raise AssertionError("every reason has one sentence")


def refusal(reason: Reason, found: str = "") -> UnmeasurableError:
    """Build the error that refuses a pair: the reason's sentence, and what was found here."""
    sentence = REASONS[reason]
    return UnmeasurableError(reason, f"{sentence} ({found})" if found else sentence)
