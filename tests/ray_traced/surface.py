"""The skins of sheets: how much they send back matt and glossy, and how that varies over them."""

from dataclasses import dataclass

import cv2
import numpy as np

from ray_traced.light import Lobe

TEXEL = 0.035  # mm: half of what a pixel sees
ROW = 1024  # places that OpenCV is asked for at once


@dataclass(frozen=True)
class Finish:
    """A material: matt and glossy albedo, roughness along and across its grain.

    Variation is relative: `cloud` over millimetres, `mottle` over tenths, `fine` over a pixel,
    `streak` along the grain; `facets` are spangles, tilted by so much (rad).
    """

    matt: float
    gloss: float
    along: float
    across: float
    cloud: float = 0.0
    mottle: float = 0.0
    fine: float = 0.0
    streak: float = 0.0
    facets: float = 0.0
    wall: float = 0.6  # a cut edge sends back so much of what the face does


FINISHES = {
    "bare_steel": Finish(0.12, 0.20, 0.16, 0.32, cloud=0.06, fine=0.08, streak=0.12),
    "galvanised": Finish(0.24, 0.24, 0.25, 0.25, cloud=0.03, fine=0.05, facets=0.12),
    "ecoat_grey": Finish(0.30, 0.04, 0.22, 0.22, cloud=0.06, mottle=0.05, fine=0.015, wall=1.0),
    "ecoat_black": Finish(0.045, 0.035, 0.28, 0.28, cloud=0.06, mottle=0.05, fine=0.015, wall=1.0),
    "white_primer": Finish(0.68, 0.02, 0.30, 0.30, cloud=0.03, fine=0.02, wall=1.0),
}


@dataclass(frozen=True, eq=False)
class Skin:
    """A finish with its own texture: maps of matt and gloss, and of facets, over the plan."""

    finish: Finish
    corner: np.ndarray
    matt: np.ndarray
    gloss: np.ndarray
    lobe: Lobe
    labels: np.ndarray | None = None
    tilts: np.ndarray | None = None  # (k, 2) of the facets
    seeds: np.ndarray | None = None  # (k, 2) their places, mm

    def albedo(self, p):
        """Give matt and gloss (n,) at p (n, 2)."""
        where = ((p - self.corner) / TEXEL).astype(np.float32)
        return [self.finish.matt * look_up(self.matt, where),
                self.finish.gloss * look_up(self.gloss, where)]

    def facet_at(self, p):
        """Give the number (n,) of the facet at p (n, 2)."""
        where = np.rint((p - self.corner) / TEXEL).astype(int)
        height, width = self.labels.shape
        return self.labels[where[:, 1].clip(0, height - 1), where[:, 0].clip(0, width - 1)]


def look_up(picture, where):
    """Interpolate a map at places (n, 2) in its pixels; beyond its border, the border."""
    rows = -(-len(where) // ROW)
    padded = np.zeros((rows * ROW, 2), np.float32)
    padded[:len(where)] = where
    x, y = padded.reshape(rows, ROW, 2).transpose(2, 0, 1)
    found = cv2.remap(picture, np.ascontiguousarray(x), np.ascontiguousarray(y),
                      cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found.ravel()[:len(where)]


def cloud(rng, shape, size):
    """Make smooth noise (h, w) of unit deviation, `size` texels wide (Gaussian)."""
    step = max(1.0, size / 3.0)
    small = [int(side / step) + 8 for side in shape]
    noise = cv2.GaussianBlur(rng.standard_normal(small, dtype=np.float32), (0, 0), size / step)
    noise /= noise.std()
    if step > 1.0:
        noise = cv2.resize(noise, (int(small[1] * step), int(small[0] * step)),
                           interpolation=cv2.INTER_CUBIC)
    return noise[:shape[0], :shape[1]]


def streaks(rng, shape, turn):
    """Make noise of unit deviation, drawn out in the direction `turn`, as rolling leaves it."""
    side = int(np.hypot(*shape)) + 2
    total = np.zeros((side, side), np.float32)
    for length, width, weight in ((25.0, 1.2, 0.7), (90.0, 2.2, 0.6), (300.0, 7.0, 0.4)):
        noise = rng.standard_normal((side, int(side / 8) + 8), dtype=np.float32)
        noise = cv2.GaussianBlur(noise, (0, 0), sigmaX=length / 8.0, sigmaY=width)
        total += weight * cv2.resize(noise / noise.std(), (side, side))
    middle = (side - 1) / 2.0
    turning = cv2.getRotationMatrix2D((middle, middle), -np.degrees(turn), 1.0)
    turning[:, 2] += [(shape[1] - side) / 2.0, (shape[0] - side) / 2.0]
    return cv2.warpAffine(total, turning, (shape[1], shape[0]), borderMode=cv2.BORDER_REFLECT)


def make_skin(rng, finish, low, high):
    """Make the skin of a finish over the plan from `low` (2,) to `high` (2,), mm."""
    shape = tuple(int(side / TEXEL) + 3 for side in (high - low)[::-1])
    turn = rng.uniform(0.0, np.pi)
    groove = np.array([np.cos(turn), np.sin(turn), 0.0])
    texture = 1.0 + finish.cloud * cloud(rng, shape, rng.uniform(60.0, 150.0))
    for amount, size in ((finish.mottle, rng.uniform(10.0, 25.0)), (finish.fine, 1.0)):
        if amount:
            texture += amount * cloud(rng, shape, size)
    gloss = texture.copy()
    if finish.streak:
        gloss += finish.streak * streaks(rng, shape, turn)
    labels = tilts = seeds = None
    if finish.facets:
        labels, seeds = spangles(rng, shape, low)
        tilts = rng.normal(0.0, finish.facets, (len(seeds), 2))
        gloss *= facet_lines(rng, labels, len(seeds), low)
    return Skin(finish, low, texture.clip(0.05, None), gloss.clip(0.05, None),
                Lobe(finish.along, finish.across, groove), labels, tilts, seeds)


def spangles(rng, shape, low):
    """Divide the plan into crystals: their numbers (h, w) and places (k, 2) in mm."""
    grain = rng.uniform(1.6, 3.0) / TEXEL
    count = int(shape[0] * shape[1] / grain ** 2)
    seeds = rng.uniform([2, 2], [shape[1] - 3, shape[0] - 3], (count, 2)).astype(int)
    empty = np.full(shape, 255, np.uint8)
    empty[seeds[:, 1], seeds[:, 0]] = 0
    _, labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5,
                                                labelType=cv2.DIST_LABEL_PIXEL)
    y, x = np.mgrid[:shape[0], :shape[1]].astype(np.float32)
    bend = [grain * 0.12 * cloud(rng, shape, grain * size) for size in (0.3, 0.3)]
    labels = cv2.remap(labels.astype(np.float32), x + bend[0], y + bend[1], cv2.INTER_NEAREST,
                       borderMode=cv2.BORDER_REFLECT).astype(int)
    places = np.zeros((labels.max() + 1, 2))
    places[labels[seeds[:, 1], seeds[:, 0]]] = low + seeds * TEXEL
    return labels, places


def facet_lines(rng, labels, count, low):
    """Give the fine lines (h, w) of the crystals: each has its own direction and pitch."""
    turn, pitch = rng.uniform(0, np.pi, count), rng.uniform(0.2, 0.5, count)
    strength = rng.choice([0.0, 0.08, 0.16], count)
    y, x = np.mgrid[:labels.shape[0], :labels.shape[1]].astype(np.float32) * np.float32(TEXEL)
    wave = 2.0 * np.pi / pitch
    phase = (np.cos(turn) * wave)[labels] * x + (np.sin(turn) * wave)[labels] * y
    return (1.0 + strength[labels] * np.sin(phase)).astype(np.float32)
