"""What every pixel sees: rays through the lens, area-sampled, and the light they bring back."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ray_traced.plate import VOID, Rays
from ray_traced.shading import Shading

SIDE = 2        # rays a pixel: SIDE x SIDE, and where two surfaces meet
FINER, STRIDE = 144, 89  # as many as this: neighbours in Fibonacci's row make an even lattice


@dataclass(frozen=True, eq=False)
class Light:
    """Radiances (h, w) of one view: by the ring, by the room (side light, sky), by the laser."""

    ring: np.ndarray
    room: np.ndarray
    laser: np.ndarray
    seen: np.ndarray  # (h, w): 8 x sheet + kind of the pixel's first ray


@lru_cache(maxsize=4)
def _grid(sensor):
    """Give the slopes (n, 2) in the camera frame of the rays of all pixels, SIDE x SIDE each."""
    width, height = sensor.size
    part = (np.arange(SIDE) + 0.5) / SIDE - 0.5
    x = (np.arange(width)[:, None] + part).ravel()
    y = (np.arange(height)[:, None] + part).ravel()
    return sensor.slopes(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))


def rays_in_plate(scene, slopes):
    """Turn slopes (n, 2) in the camera frame into rays of the plate's frame."""
    turned = slopes @ scene.turn[:2] + scene.turn[2]
    return Rays(-scene.centre @ scene.turn, turned[:, :2] / turned[:, 2:])


def trace(sheets, rays):
    """Say what rays meet first: sheet (n,), kind (n,), depth (n,)."""
    count = len(rays.slopes)
    which, kinds = np.zeros(count, np.int8), np.zeros(count, np.int8)
    depths = np.zeros(count)
    left = np.arange(count)
    for number, sheet in enumerate(sheets):
        found, depth = sheet.meet(rays[left] if len(left) < count else rays)
        hit = found != VOID
        which[left[hit]], kinds[left[hit]], depths[left[hit]] = number, found[hit], depth[hit]
        left = left[~hit]
    return which, kinds, depths


def look(scene):
    """Trace a scene through its sensor's lens: the light of every pixel, before the blur."""
    width, height = scene.sensor.size
    rays = rays_in_plate(scene, _grid(scene.sensor))
    hits = trace(scene.sheets, rays)
    shading = Shading(scene, rays, hits)
    light = shading.radiance(rays, hits)
    light = light.reshape(height, SIDE, width, SIDE, 3).mean(axis=(1, 3))
    labels = (hits[0] * 8 + hits[1]).reshape(height, SIDE, width, SIDE)
    y, x = np.nonzero(_borders(labels))
    parts = _spread(np.random.default_rng([scene.seed, 6]), len(y))
    slopes = scene.sensor.slopes(np.stack([x, y], axis=-1)[:, None] + parts).reshape(-1, 2)
    rays = rays_in_plate(scene, slopes)
    finer = shading.radiance(rays, trace(scene.sheets, rays))
    light[y, x] = finer.reshape(len(y), FINER, 3).mean(axis=1)
    return Light(*np.moveaxis(light, -1, 0), labels[:, 0, :, 0])


def _spread(rng, count):
    """Spread FINER points evenly over each of `count` pixels (count, FINER, 2).

    Each pixel shifts the lattice by chance, or an edge along its rows would be off in many.
    """
    lattice = np.arange(FINER)[:, None] * [1, STRIDE] / FINER
    return (lattice + rng.uniform(size=(count, 1, 2))) % 1.0 - 0.5


def _borders(labels):
    """Mark the pixels (h, w) where surfaces meet, and those beside them."""
    low, high = labels.min(axis=(1, 3)), labels.max(axis=(1, 3))
    padded_low, padded_high = np.pad(low, 1, mode="edge"), np.pad(high, 1, mode="edge")
    height, width = low.shape
    for dy in range(3):
        for dx in range(3):
            window = (slice(dy, dy + height), slice(dx, dx + width))
            low, high = np.minimum(low, padded_low[window]), np.maximum(high, padded_high[window])
    return low != high
