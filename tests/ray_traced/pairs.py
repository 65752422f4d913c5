"""A scene's two pictures and its truth."""

from dataclasses import dataclass

import numpy as np

from ray_traced.detector import WHITE, speckled
from ray_traced.picture import look
from ray_traced.plate import FACE
from ray_traced.sensor import Sensor

NORMAL_OFF = np.radians(0.3)   # of a plan, per axis; at most twice that
RADIUS_OFF = 0.05              # mm, at most


@dataclass(frozen=True, eq=False)
class Pair:
    """Hole image and stripe image (h, w) uint8, the truth as `truth.json` has it, the sensor."""

    hole: np.ndarray
    stripe: np.ndarray
    truth: dict
    sensor: Sensor


def render(scene):
    """Render a pair: two exposures of what the scene's lens makes of its light."""
    rng, light = np.random.default_rng([scene.seed, 2]), look(scene)
    through = scene.lens.shade(scene.sensor.size)
    lit, room, laser = (scene.lens.blurred(part * through)
                        for part in (light.ring + light.room, light.room, light.laser))
    exposure, face = scene.exposure, light.seen == 8 * scene.plate + FACE
    gain = exposure.face / np.median(lit[face])
    if exposure.clipped:
        gain = WHITE / np.quantile(lit[face], 1.0 - exposure.clipped)
    hole = scene.chip.expose(rng, lit * gain)
    laser = speckled(rng, laser * (exposure.stripe / _middle(laser, face)), scene.speckle)
    stripe = scene.chip.expose(rng, laser + room * (exposure.room / np.median(room[face])))
    first, second = (stripe, hole) if scene.swapped else (hole, stripe)
    return Pair(first, second, truth_of(scene, light), scene.sensor)


def _middle(laser, face):
    """Give how bright the stripe's middle is in the rows where it lies on the plate."""
    rows = np.where(face, laser, 0.0).max(axis=1)
    return np.median(rows[rows > 0.1 * rows.max()]) if rows.any() else 1.0


def truth_of(scene, light):
    """Write what is true of a scene, as the reference images' `truth.json` has it."""
    label, normal = scene.label, -scene.turn[:, 2]
    truth = {
        "sensor": scene.sensor.name, "difficulty": label.difficulty,
        "tags": sorted({*label.tags, *seen_tags(scene, light)}),
        "valid": label.reason is None, "reason": label.reason,
        "centre_mm": scene.centre.tolist(), "radius_mm": scene.radius, "normal": normal.tolist(),
        "tilt_total_deg": float(np.degrees(np.arccos(-normal[2]))),
        "thickness_mm": scene.sheets[scene.plate].thickness, "material": label.material,
        "edge_ambiguity_mm": label.ambiguity, "nominal": nominal_of(scene, normal),
        "seed": scene.seed, "blur_px": scene.lens.blur}
    if label.reason:
        truth["note"] = "geometry as rendered; not to be reported by a measuring system"
    return truth


def seen_tags(scene, light):
    """Name what follows from the material or is seen inside the hole."""
    yield from {"galvanised": ("galv",), "ecoat_black": ("black",)}.get(scene.label.material, ())
    plate = light.seen == 8 * scene.plate + FACE
    behind = (light.seen == 8 * (scene.plate + 1) + FACE) & inside_hole(scene)
    if behind.any():
        if np.median(light.ring[behind]) > 0.8 * np.median(light.ring[plate]):
            yield "bright_behind"
        if light.laser[behind].max() > 0.3 * light.laser[plate].max(initial=0.0):
            yield "stripe_in_hole"


def inside_hole(scene):
    """Mark the pixels (h, w) that lie within the hole's radius of its centre."""
    width, height = scene.sensor.size
    x, y = scene.sensor.project(scene.centre)
    radius = scene.radius * scene.sensor.focal[0] / scene.centre[2]
    return np.hypot(np.arange(width) - x, np.arange(height)[:, None] - y) < radius


def nominal_of(scene, normal):
    """Give what a plan would say: radius and normal a little off, the thickness right."""
    rng = np.random.default_rng([scene.seed, 3])
    off = np.clip(rng.normal(0.0, NORMAL_OFF, 2), -2.0 * NORMAL_OFF, 2.0 * NORMAL_OFF)
    leaning = normal + scene.turn[:, :2] @ off
    return {"radius_mm": round(scene.radius + rng.uniform(-RADIUS_OFF, RADIUS_OFF), 4),
            "normal": (leaning / np.linalg.norm(leaning)).round(6).tolist(),
            "thickness_mm": scene.sheets[scene.plate].thickness}
