"""Advise another exposure from what the pictures show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cell.core.observation import Image, Light, Observation

WANTED = 180.0  # of 255: where the brightest thing that matters should lie
FULL = 250  # grey values from here on may be cut off
BRIGHT_SHARE: Mapping[Light, float] = {"ring": 0.02, "laser": 0.002}  # of the picture
LEAST, MOST = 0.25, 4.0  # one step of exposure


def advise_exposure(observation: Observation) -> dict[Light, float]:
    """Advise by which factor to expose longer, for each light, by its newest picture."""
    newest: dict[Light, Image] = {view.light: view.image for view in observation.views}
    return {light: _factor(newest[light], BRIGHT_SHARE[light]) if light in newest else 1.0
            for light in BRIGHT_SHARE}


def _factor(image: Image, share: float) -> float:
    """Bring the brightest part of a picture to where it is bright and not cut off."""
    bright = float(np.quantile(image, 1.0 - share))
    if bright >= FULL:
        return 0.5  # how far beyond it lies cannot be seen
    return float(np.clip(WANTED / max(bright, 1.0), LEAST, MOST))
