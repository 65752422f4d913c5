"""Find the laser stripe on a sphere: an arc, seen where the sphere must be."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import SensorModel
from cell.metrology.detect.ridge import runs_upright
from cell.metrology.detect.stripe_centres import HALF_WINDOW, centre_stripe

SMOOTH = 1.5        # px
REACH = 12.0        # mm around the sphere that are looked at: so rough its place may be
FAINT = 0.3         # of the stripe's usual height: at the sphere's edge the light grazes
DIM = 12.0          # grey, below which nothing is a stripe
CLIPPED = 250       # grey, from which a stripe has lost its summit
LEAST_LINES = 60


@dataclass(frozen=True, eq=False)
class Arc:
    """A curved stripe: where it lies across (length,) px on every line of the image."""

    summits: Array
    upright: bool

    def across(self, v: Array) -> Array:
        """Say where it lies on lines v."""
        return self.summits[v.astype(np.intp)]


def detect_sphere_stripe(stripe: Image, sensor: SensorModel, centre_in_camera: Array,
                         radius: float) -> Array:
    """Locate the stripe on a sphere: pixels (n, 2), one for each line of the image.

    Args:
        stripe: the picture with the laser on.
        sensor: the sensor as believed.
        centre_in_camera: (3,) mm, good to some millimetres.
        radius: of the sphere, mm.

    Raises:
        UnmeasurableError: `no_stripe`.
    """
    arc, lines = _look(stripe, sensor, centre_in_camera, radius)
    across, height = centre_stripe(stripe, arc, lines)
    lit = np.median(height[height > DIM]) if (height > DIM).any() else 0.0
    kept = (height > max(DIM, FAINT * lit)) & (height < CLIPPED)
    if kept.sum() < LEAST_LINES:
        raise UnmeasurableError("no_stripe", f"{kept.sum()} lines of stripe on the sphere")
    pixels = np.column_stack([across[kept], lines[kept]])
    return pixels if arc.upright else pixels[:, ::-1]


def _look(stripe: Image, sensor: SensorModel, centre: Array, radius: float) -> tuple[Arc, Array]:
    """Follow the brightest pixels where the sphere must be, on the lines (n,) that cross it."""
    upright = runs_upright(sensor.light_plane)
    turned = cv2.GaussianBlur(stripe if upright else np.ascontiguousarray(stripe.T), (0, 0), SMOOTH)
    half = (radius + REACH) * float(sensor.camera.matrix[0, 0]) / float(centre[2])
    u, v = sensor.camera.project(centre)[::1 if upright else -1]
    left, right = _span(u, half, turned.shape[1], HALF_WINDOW + 1)
    top, bottom = _span(v, half, turned.shape[0], 0)
    if right <= left or bottom - top < LEAST_LINES:
        raise UnmeasurableError("no_stripe", "the sphere is out of the picture")
    summits = left + turned[:, left:right].argmax(axis=1).astype(np.float64)
    return Arc(summits, upright), np.arange(top, bottom, dtype=np.float64)


def _span(place: float, half: float, size: int, edge: int) -> tuple[int, int]:
    return max(edge, int(place - half)), min(size - edge, int(place + half) + 1)
