"""Openings that are no whole round hole, drawn at any turn, and named by their outline."""

import cv2
import numpy as np
import pytest

from cell.metrology.detect.opening import name_opening
from cell.metrology.detect.ridge import find_ridges

SIZE, RADIUS = (500, 440), 60.0
ROUND = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
CIRCLE = RADIUS * np.column_stack([np.cos(ROUND), np.sin(ROUND)])


def slot(length):
    return CIRCLE + np.where(CIRCLE[:, :1] > 0, 0.5, -0.5) * np.array([length * RADIUS, 0.0])


def covered(share):
    """The circle as far as a straight edge lets it be seen."""
    return np.column_stack([np.minimum(CIRCLE[:, 0], (1.0 - 2.0 * share) * RADIUS), CIRCLE[:, 1]])


def square(rounding):
    box = RADIUS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (1.0 - rounding)
    corners = np.repeat(box, 60, axis=0)
    quarter = np.concatenate([start + np.linspace(0.0, np.pi / 2.0, 60)
                              for start in np.pi / 2.0 * np.arange(2, 6)])
    return corners + rounding * RADIUS * np.column_stack([np.cos(quarter), np.sin(quarter)])


def pictured(shape, turn_deg, *, shift=(0.0, 0.0), seed=3):
    """The opening on a textured sheet with dirt at its edge, and the stripe that it interrupts."""
    rng, turn = np.random.default_rng(seed), np.radians(turn_deg)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = (shape - shape.mean(axis=0)) @ matrix.T + np.array(SIZE) / 2.0 + shift
    opening = cv2.fillPoly(np.zeros(SIZE[::-1], np.uint8), [np.rint(points).astype(np.int32)], 1)
    sheet = 120.0 + 8.0 * cv2.GaussianBlur(rng.normal(size=opening.shape), (0, 0), 2.0) / 0.14
    for place in points[::60]:
        cv2.circle(sheet, tuple(int(c) for c in place), 4, 40.0, -1)
    stripe = 160.0 * np.exp(-0.5 * ((np.arange(SIZE[0]) - SIZE[0] / 2.0) / 2.2) ** 2)
    pictures = np.where(opening, 10.0, sheet), np.where(opening, 0.0, stripe[None]) + 3.0
    return [np.clip(cv2.GaussianBlur(grey, (0, 0), 1.0) + rng.normal(0, 2, grey.shape), 0, 255)
            .astype(np.uint8) for grey in pictures]


def named(shape, turn_deg, **where):
    hole_image, stripe_image = pictured(shape, turn_deg, **where)
    return name_opening(hole_image, find_ridges(stripe_image, upright=True)[0])


@pytest.mark.parametrize("turn_deg", [0, 20, 45, 70, 115, 160])
@pytest.mark.parametrize(("reason", "shape"), [
    ("slot", slot(0.5)), ("slot", slot(1.5)), ("not_round", square(0.1)),
    ("not_round", square(0.3)), ("half_occluded", covered(0.5)), ("half_occluded", covered(0.3)),
    (None, CIRCLE)])
def test_the_outline_names_the_opening(reason, shape, turn_deg):
    assert named(shape, turn_deg, shift=(10.0, 5.0)) == reason


def test_an_opening_at_the_border_is_cut_by_it():
    assert named(CIRCLE, 0, shift=(-160.0, 0.0)) is None  # the stripe passes beside it
    hole_image, stripe_image = (picture[:, 200:] for picture in pictured(CIRCLE, 0))
    ridge = find_ridges(np.ascontiguousarray(stripe_image), upright=True)[0]
    assert name_opening(np.ascontiguousarray(hole_image), ridge) == "hole_cut_by_border"


def test_an_opening_as_bright_as_the_sheet_has_no_outline():
    _, stripe_image = pictured(CIRCLE, 0)
    ridge = find_ridges(stripe_image, upright=True)[0]
    assert name_opening(np.full(SIZE[::-1], 120, np.uint8), ridge) is None
