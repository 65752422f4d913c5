"""What surfaces look like: how they shine, and the pattern that rolling, zinc or paint leaves.

A pattern is a tile of relative brightness that repeats over the sheet; its mean is 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

TILE = 1024          # texels along each side
TEXEL_MM = 0.06      # about a pixel at the working distance
CRYSTALS = 900       # of zinc on a tile

Tile = NDArray[np.float32]


@dataclass(frozen=True)
class Finish:
    """How a surface answers light: grey shares of a white sheet.

    `diffuse` goes by the cosine, `gloss` in a lobe of width `lobe` (rad) about the mirror
    direction; `stripe` is what comes back of the laser, `speckle` its contrast before the lens.
    """

    diffuse: float
    gloss: float
    lobe: float
    stripe: float
    speckle: float


FINISHES = {
    "steel": Finish(diffuse=0.35, gloss=0.40, lobe=0.16, stripe=0.50, speckle=0.80),
    "galvanised": Finish(diffuse=0.38, gloss=0.45, lobe=0.20, stripe=0.55, speckle=0.75),
    "ecoat_grey": Finish(diffuse=0.42, gloss=0.10, lobe=0.25, stripe=0.45, speckle=0.60),
    "ecoat_black": Finish(diffuse=0.10, gloss=0.06, lobe=0.22, stripe=0.14, speckle=0.60),
    "primer": Finish(diffuse=0.62, gloss=0.05, lobe=0.30, stripe=0.60, speckle=0.55),
    "ceramic": Finish(diffuse=0.75, gloss=0.00, lobe=0.30, stripe=0.65, speckle=0.45),
}


@lru_cache(maxsize=16)
def pattern(finish: str) -> Tile:
    """Return the tile (TILE, TILE) of a finish: always the same one."""
    chance = np.random.default_rng([*finish.encode()])
    make = {"steel": _brushed, "galvanised": _spangled, "ceramic": _even}.get(finish, _painted)
    tile = make(chance)
    return np.clip(tile / tile.mean(), 0.2, 2.2).astype(np.float32)


def _brushed(chance: np.random.Generator) -> Tile:
    """Rolled steel: streaks along the rolling direction, of many lengths, on a mottled ground."""
    return 1.0 + _noise(chance, (90, 0.7, 0.09), (30, 0.9, 0.06), (8, 1.2, 0.04), (40, 40, 0.08))


def _painted(chance: np.random.Generator) -> Tile:
    """Paint: a faint orange peel, a fainter cloud, grains."""
    return 1.0 + _noise(chance, (6, 6, 0.02), (40, 40, 0.03), (1, 1, 0.012))


def _even(chance: np.random.Generator) -> Tile:  # noqa: ARG001  ceramic has no pattern
    return np.ones((TILE, TILE), np.float32)


def _spangled(chance: np.random.Generator) -> Tile:
    """Hot-dip zinc: crystals of some 2 mm, each with a brightness and a fine ribbing of its own."""
    crystal = _crystals(chance)
    count = int(crystal.max()) + 1
    level = chance.gamma(9.0, 1.0 / 9.0, count)
    angle, pitch = chance.uniform(0, np.pi, count), chance.uniform(0.5, 1.1, count)
    rows, columns = np.indices(crystal.shape, dtype=np.float32)
    phase = pitch[crystal] * (np.cos(angle)[crystal] * columns + np.sin(angle)[crystal] * rows)
    ribs = 0.05 * np.sin(phase) * (chance.uniform(0, 1, count) > 0.5)[crystal]
    tile = (level[crystal] + ribs + _noise(chance, (1, 1, 0.03))).astype(np.float32)
    return cv2.GaussianBlur(tile, (0, 0), 0.6)


def _crystals(chance: np.random.Generator) -> NDArray[np.int32]:
    """Number the cells of a Voronoi pattern that repeats over the tile."""
    spots = chance.integers(0, TILE, (CRYSTALS, 2))
    copies = np.stack(np.meshgrid([-TILE, 0, TILE], [-TILE, 0, TILE]), axis=-1).reshape(-1, 1, 2)
    around = (spots + copies + TILE // 2).reshape(-1, 2)
    inside = ((around >= 0) & (around < 2 * TILE)).all(axis=1)
    rows, columns = around[inside].T
    seeds = np.full((2 * TILE, 2 * TILE), 255, np.uint8)
    seeds[rows, columns] = 0
    _, labels = cv2.distanceTransformWithLabels(seeds, cv2.DIST_L2, 5,
                                                labelType=cv2.DIST_LABEL_PIXEL)
    number = np.zeros(int(labels.max()) + 1, np.int32)
    number[labels[rows, columns]] = np.flatnonzero(inside) % CRYSTALS
    half = TILE // 2
    return number[labels[half:half + TILE, half:half + TILE]]


def _noise(chance: np.random.Generator, *parts: tuple[float, float, float]) -> Tile:
    """Return periodic noise whose power is the sum of its parts'.

    A part is smooth over `along` columns and `across` rows (texels) and has its own standard
    deviation.
    """
    down, right = np.fft.fftfreq(TILE)[:, None], np.fft.rfftfreq(TILE)[None, :]
    power = np.zeros((TILE, TILE // 2 + 1), np.float32)
    for along, across, deviation in parts:
        bell = np.exp(-4.0 * np.pi**2 * ((across * down) ** 2 + (along * right) ** 2))
        power += deviation**2 * bell / bell.mean()
    white = fft.rfft2(chance.standard_normal((TILE, TILE), dtype=np.float32))
    return fft.irfft2(white * np.sqrt(power)).astype(np.float32)
