"""Locate a hole from one pair of images: detect in both, then estimate in the camera frame."""

from __future__ import annotations

from typing import Literal, TypeAlias

from cell.core.documents.result import Located
from cell.core.geometry import Transform
from cell.core.observation import Image
from cell.core.optics import SensorModel
from cell.metrology.detect.pair import detect_pair
from cell.metrology.features import Expected
from cell.metrology.locate.joint import locate_joint
from cell.metrology.locate.two_step import locate_two_step

Method: TypeAlias = Literal["joint", "two-step"]


def locate_pair(hole_image: Image, stripe_image: Image, sensor: SensorModel, expected: Expected,
                method: Method = "joint") -> Located:
    """Locate the hole that the stripe crosses, in the camera frame.

    Raises:
        UnmeasurableError: the pair carries no measurement, with one of the documented reasons.
    """
    rim, stripe = detect_pair(hole_image, stripe_image, sensor, expected)
    if method == "two-step":
        return locate_two_step(rim, stripe, sensor, expected)
    return locate_joint(rim, [(stripe, Transform.identity())], sensor, expected)
