"""Marks on a skin: scratches, dirt and weld spatter, drawn into its maps."""

import cv2
import numpy as np

from ray_traced.surface import TEXEL, cloud

FINER = 4  # binary places of OpenCV's drawing


def scratch(rng, skin, count):
    """Draw slightly bent scratches, all brighter or all darker than the skin."""
    shape = skin.matt.shape
    bright = rng.random() < 0.5
    for _ in range(count):
        line = np.zeros(shape, np.uint8)
        start, turn = rng.uniform(0, 1, 2) * shape[::-1], rng.uniform(0, 2 * np.pi)
        s = np.linspace(0.0, rng.uniform(4.0, 30.0) / TEXEL, 40)
        bend = rng.normal(0.0, 1e-3) * TEXEL
        points = start + np.stack([s * np.cos(turn + bend * s), s * np.sin(turn + bend * s)], 1)
        cv2.polylines(line, [np.rint(points * 2 ** FINER).astype(np.int32)], False, 255,
                      int(rng.integers(1, 4)), cv2.LINE_AA, FINER)
        cover = line.astype(np.float32) / 255.0 * rng.uniform(0.3, 0.9)
        skin.matt[:] *= 1.0 + cover * (0.4 if bright else -0.5)
        skin.gloss[:] *= 1.0 + cover * (1.0 if bright else -0.7)


def soil(rng, skin):
    """Lay patches of dirt over the skin: darker, and dull."""
    size = rng.uniform(0.3, 1.2) / TEXEL
    patches = cloud(rng, skin.matt.shape, size) + 0.5 * cloud(rng, skin.matt.shape, size / 4.0)
    cover = ((patches - rng.uniform(1.4, 2.0)) / 0.8).clip(0.0, 1.0)
    skin.matt[:] *= 1.0 - 0.45 * cover
    skin.gloss[:] *= 1.0 - 0.7 * cover


def spatter(rng, skin, count):
    """Throw weld beads on the skin: dark balls with a bright point towards a light."""
    towards = rng.uniform(0, 2 * np.pi)
    for _ in range(count):
        at, radius = rng.uniform(0, 1, 2) * skin.matt.shape[::-1], rng.uniform(0.12, 0.45) / TEXEL
        low = np.maximum(at - radius - 2, 0).astype(int)
        window = (slice(low[1], int(at[1] + radius) + 3), slice(low[0], int(at[0] + radius) + 3))
        y, x = np.mgrid[window[0], window[1]]
        y, x = (part[:skin.matt[window].shape[0], :skin.matt[window].shape[1]] for part in (y, x))
        cover = ((radius - np.hypot(x - at[0], y - at[1])) / 2.0 + 0.5).clip(0.0, 1.0)
        light = np.hypot(x - at[0] - 0.4 * radius * np.cos(towards),
                         y - at[1] - 0.4 * radius * np.sin(towards))
        skin.matt[window] *= 1.0 - 0.6 * cover
        skin.gloss[window] *= 1.0 - cover * (0.8 - 1.5 * np.exp(-(light / (0.3 * radius)) ** 2))


def mark(rng, skin, marks):
    """Mark a skin by names: scratches, dirt, spatter."""
    if "scratches" in marks:
        scratch(rng, skin, int(rng.integers(4, 12)))
    if "dirt" in marks:
        soil(rng, skin)
    if "spatter" in marks:
        spatter(rng, skin, int(rng.integers(8, 40)))
