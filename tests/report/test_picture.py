"""The picture of a pair: what was found is drawn where it lies, a refusal says why."""

import cv2
import numpy as np
import pytest
from drawn_pictures import Scene

from cell.core.errors import UnmeasurableError
from cell.metrology.locate.pair import locate_pair
from cell.report.picture import AMBER, CYAN, GREEN, PINK, RED, draw_pair


def decoded(png: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)


def shows(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(picture.astype(int) - colour).max(axis=2) < 8).sum())


@pytest.fixture(scope="module")
def pair():
    scene = Scene(tilt=(2.0, 3.0))
    return scene, scene.hole_image(), scene.stripe_image()


def test_everything_found_is_drawn(pair):
    scene, hole, stripe = pair
    located = locate_pair(hole, stripe, scene.sensor, scene.expected())
    picture = decoded(draw_pair(hole, stripe, located))
    for colour in (GREEN, AMBER, CYAN, PINK):
        assert shows(picture, colour) > 60
    assert shows(picture, RED) == 0
    left, right = np.array_split(picture, 2, axis=1)
    assert shows(left[:-120], AMBER) == 0
    assert shows(right[:-120], AMBER) > 300


def test_a_refusal_says_why(pair):
    _, hole, stripe = pair
    picture = decoded(draw_pair(hole, stripe, UnmeasurableError("slot", "longer than wide")))
    assert shows(picture, RED) > 300
    assert shows(picture, GREEN) == 0


def test_a_dark_picture_is_brightened_for_the_eye(pair):
    _, hole, stripe = pair
    dark = (hole // 8).astype(np.uint8)
    picture = decoded(draw_pair(dark, stripe, UnmeasurableError("too_dark", "no light")))
    assert picture[60:-120].max() > 150
