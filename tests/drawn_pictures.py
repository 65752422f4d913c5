"""Pictures of holes, drawn: outlines filled at a multiple of the resolution, blurred and sampled.

Knows nothing of the detector: its own projection of circles, its own stripe, its own noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from cell.core.geometry import Plane
from cell.core.optics import CameraModel, SensorModel
from cell.metrology.features import Expected

FINE = 3  # subpixels per pixel and direction
LENS = np.array([0.05, -0.1, 0.001, -0.002, 0.0])


def made_sensor(size=(384, 320), *, upright=True, focal=3480.0, distance=245.0, alpha=29.0):
    """A sensor whose light plane gives an upright or a lying stripe, the optic axis off centre."""
    matrix = np.array([[focal, 0.0, 0.45 * size[0]], [0.0, 0.9965 * focal, 0.53 * size[1]],
                       [0.0, 0.0, 1.0]])
    across, along = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
    normal = np.array([across, 0.003, along] if upright else [0.003, across, along])
    plane = Plane.through([0.0, 0.0, distance], normal)
    return SensorModel(CameraModel(size, matrix, LENS), plane)


@dataclass
class Scene:
    """A hole in a sheet, what disturbs it, and how it is lit and seen. mm, px, grey values."""

    seed: int = 0
    sensor: SensorModel = field(default_factory=made_sensor)
    centre: tuple = (0.6, -0.8, 244.0)
    tilt: tuple = (2.0, -1.5)        # degrees about x and y
    radius: float = 5.0
    thickness: float = 1.0
    plate: float = 130.0
    wall: float = 12.0
    behind: float = 8.0
    blur: float = 0.9
    noise: float = 3.0
    surface: str = "plain"           # brushed, spangled
    gradient: float = 0.0            # of the light across the picture, as a share
    burr: float = 0.0                # mm, outward, on a third of the rim
    waves: dict = field(default_factory=dict)  # mm of the rim's form, by crests
    dark_arc: float = 0.0            # degrees of the rim in shadow
    glints: int = 0
    scratches: int = 0
    neighbour: bool = False
    shape: str = "round"             # slot, square, none
    cover: float | None = None       # share of the hole under a flap
    stripe: float = 150.0
    speckle: float = 0.3
    stripe_width: float = 2.0
    stripe_behind: float = 0.0       # mm below the sheet, where a second sheet shows the stripe
    ambient: float = 0.0
    stripe_step: float = 0.0         # mm by which the sheet on one side of the hole lies deeper

    def __post_init__(self):
        self.random = np.random.default_rng(self.seed)

    @property
    def normal(self):
        a, b = np.radians(self.tilt)
        return np.array([np.sin(b), -np.sin(a), -np.sqrt(1 - np.sin(a)**2 - np.sin(b)**2)])

    def expected(self, *, wrong_radius=0.03):
        """What a plan would say: a little wrong."""
        off = self.normal + 0.005 * self.random.normal(size=3)
        return Expected(centre=np.array(self.centre) + self.random.normal(size=3) * 0.5,
                        centre_sigma=2.0, normal=off / np.linalg.norm(off),
                        radius=self.radius + wrong_radius, thickness=self.thickness)

    def outline(self, depth=0.0, grow=0.0, count=720):
        """Points (count, 2) px of the opening's edge, `depth` mm under the camera-side face."""
        n = self.normal
        u = np.cross(n, [0.0, 1.0, 0.0])
        u /= np.linalg.norm(u)
        turn = np.linspace(0.0, 2 * np.pi, count, endpoint=False)[:, None]
        form = sum(height * np.cos(crests * turn + 0.4) for crests, height in self.waves.items())
        flat = _outline(self.shape, self.radius + grow + form, count)
        face = np.array(self.centre) - n * depth
        return self.sensor.camera.project(face + flat @ np.stack([u, np.cross(n, u)]))

    def hole_image(self):
        """The picture under the ring light."""
        width, height = self.sensor.camera.image_size
        light = self._light(width, height)
        sheet = self._sheet(width, height) * light
        sheet = cv2.resize(sheet.astype(np.float32), None, fx=FINE, fy=FINE)
        opening, through = self._openings(width, height)
        grey = sheet * (1 - opening)
        grey += opening * (through * self.behind + (1 - through) * self.wall)
        self._disturb(grey)
        return self._expose(grey)

    def stripe_image(self):
        """The picture under the laser."""
        width, height = self.sensor.camera.image_size
        opening, through = self._openings(width, height)
        laser = self._line(0.0, width, height)
        if self.stripe_step:
            laser[len(laser) // 2:] = self._line(self.stripe_step, width, height)[len(laser) // 2:]
        grey = laser * (1 - opening)
        if self.stripe_behind:
            grey += self._line(self.stripe_behind, width, height) * opening * through
        grey += self.ambient * (1 - opening)
        return self._expose(grey)

    def _light(self, width, height):
        ramp = np.linspace(-0.5, 0.5, width)[None] + np.linspace(-0.3, 0.3, height)[:, None]
        return 1.0 + self.gradient * ramp

    def _sheet(self, width, height):
        base = np.full((height, width), self.plate)
        if self.surface == "brushed":
            streaks = self.random.normal(size=(height, width))
            streaks = cv2.GaussianBlur(streaks, (0, 0), 12.0, None, 0.6)
            base *= 1.0 + 0.12 * streaks / streaks.std()
        if self.surface == "spangled":
            seeds = np.ones((height, width), np.uint8)
            places = self.random.integers(0, [height, width], (300, 2))
            seeds[places[:, 0], places[:, 1]] = 0
            _, grain = cv2.distanceTransformWithLabels(seeds, cv2.DIST_L2, 5,
                                                       labelType=cv2.DIST_LABEL_PIXEL)
            base *= (0.7 + 0.6 * self.random.random(grain.max() + 1))[grain]
        for _ in range(self.scratches):
            ends = self.random.integers(0, [width, height], (2, 2))
            line = cv2.line(np.zeros((height, width), np.uint8), ends[0].tolist(),
                            ends[1].tolist(), 1, 1)
            base *= 1.0 - 0.4 * line
        return base

    def _openings(self, width, height):
        """Masks of the opening in the near face, and of what is seen through the far one."""
        if self.shape == "none":
            return np.zeros((2, height * FINE, width * FINE), np.float32)
        bite = 0.0
        if self.burr:
            waves = cv2.GaussianBlur(np.random.default_rng(self.seed + 1).random(720), (0, 0), 4)
            ragged = np.clip((waves.ravel() - waves.mean()) / waves.std() + 0.5, 0.0, 2.0) / 2.0
            bite = self.burr * ragged[:, None] * (np.arange(720)[:, None] % 360 < 130)
        near, far = self.outline(grow=bite), self.outline(depth=self.thickness, grow=bite)
        opening, through = self._fill(near, width, height), self._fill(far, width, height)
        if self.neighbour:
            beside = near + np.array([2.5, 0.4]) * np.ptp(near, axis=0) / 2
            opening = np.maximum(opening, self._fill(beside, width, height))
        if self.cover is not None:
            low = near[:, 1].max() - self.cover * np.ptp(near[:, 1])
            opening[int(low * FINE):] = 0.0
        return opening, through

    def _fill(self, points, width, height):
        """The inside of a star-shaped outline, each fine pixel by its own angle and distance."""
        middle = points.mean(axis=0)
        x, y = ((np.arange(count * FINE) + 0.5) / FINE - 0.5 - centre
                for count, centre in zip((width, height), middle, strict=True))
        angle, distance = np.arctan2(y[:, None], x[None]), np.hypot(y[:, None], x[None])
        around = np.arctan2(*(points - middle).T[::-1])
        order = np.argsort(around)
        edge = np.hypot(*(points - middle).T)[order]
        reach = np.interp(angle, around[order], edge, period=2 * np.pi)
        return (distance < reach).astype(np.float32)

    def _disturb(self, grey):
        middle = self.outline()
        centre, reach = middle.mean(axis=0), np.ptp(middle[:, 0]) / 2
        if self.dark_arc:
            y, x = np.indices(grey.shape, dtype=np.float32)
            angle = np.arctan2(y / FINE - centre[1], x / FINE - centre[0])
            start = self.random.uniform(-np.pi, np.pi)
            shade = np.mod(angle - start, 2 * np.pi) < np.radians(self.dark_arc)
            grey[shade] *= 0.12
        for _ in range(self.glints):
            t = self.random.uniform(0, 2 * np.pi)
            away = reach * self.random.uniform(0.96, 1.03)
            spot = centre + away * np.array([np.cos(t), np.sin(t)])
            size = FINE * self.random.uniform(1.5, 4.0)
            cv2.ellipse(grey, (int(spot[0] * FINE), int(spot[1] * FINE)),
                        (int(2 * size), int(size)), np.degrees(t) + 90, 0, 360, 250.0, -1)

    def _line(self, depth, width, height):
        """The laser on the plane `depth` mm under the sheet's face, at the fine resolution."""
        plane, n = self.sensor.light_plane, self.normal
        direction = np.cross(plane.normal, n)
        face = np.array(self.centre) - n * (depth)
        start = np.linalg.solve(np.stack([plane.normal, n, direction]),
                                [-plane.offset, n @ face, direction @ face])
        along = np.linspace(-40.0, 40.0, 2000)[:, None] * direction / np.linalg.norm(direction)
        x, y = self.sensor.camera.project(start + along).T
        upright = np.ptp(y) > np.ptp(x)
        fine_u = (np.arange((width if upright else height) * FINE) + 0.5) / FINE - 0.5
        fine_v = (np.arange((height if upright else width) * FINE) + 0.5) / FINE - 0.5
        order = np.argsort(y if upright else x)
        middle = np.interp(fine_v, (y if upright else x)[order], (x if upright else y)[order])
        profile = np.exp(-0.5 * ((fine_u - middle[:, None]) / self.stripe_width) ** 2)
        grains = cv2.GaussianBlur(self.random.exponential(size=profile.shape), (0, 0), 1.2 * FINE)
        grains = 1.0 + self.speckle * (grains - grains.mean()) / grains.std()
        laser = (self.stripe * profile * np.clip(grains, 0.0, None)).astype(np.float32)
        return laser if upright else laser.T

    def _expose(self, fine):
        width, height = self.sensor.camera.image_size
        soft = cv2.GaussianBlur(fine, (0, 0), self.blur * FINE)
        grey = cv2.resize(soft, (width, height), interpolation=cv2.INTER_AREA)
        grain = self.noise * np.sqrt(0.5 + 0.5 * grey / 130.0) * self.random.normal(size=grey.shape)
        return np.clip(np.rint(grey + grain), 0, 255).astype(np.uint8)


def _outline(shape, radius, count):
    t = np.linspace(0.0, 2 * np.pi, count, endpoint=False)[:, None]
    ring = np.hstack([np.cos(t), np.sin(t)])
    if shape == "slot":
        return radius * ring + np.where(ring[:, :1] > 0, 1.0, -1.0) * np.array([0.6, 0.35]) * radius
    if shape == "square":
        return radius * ring / np.abs(ring).max(axis=1, keepdims=True)
    return radius * ring
