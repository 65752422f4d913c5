"""The colours of the picture: verdicts as in the report, and one colour a thing that is drawn."""

from __future__ import annotations

VERDICTS = {"in_tolerance": (46, 160, 67), "out_of_tolerance": (218, 54, 51),
            "uncertain": (227, 151, 26), "not_measured": (140, 140, 140)}

NOMINAL = (150, 150, 160)
EDGE = (80, 220, 120)
ELLIPSE = (255, 205, 60)
ANEW = (240, 90, 240)
STRIPE = (255, 110, 110)
CHORD = (110, 190, 255)
LIMIT = (170, 170, 180)
AXES = {"x": (230, 90, 90), "y": (90, 200, 110), "z": (90, 140, 240), "d": (220, 180, 70)}


def words(verdict: str) -> str:
    """Write a verdict as people say it."""
    return verdict.replace("_", " ")
