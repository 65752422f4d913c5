"""A scene's two pictures and its truth."""

from dataclasses import dataclass

import numpy as np

from ray_traced.detector import WHITE, speckled
from ray_traced.picture import look
from ray_traced.plate import FACE

NORMAL_OFF = np.radians(0.35)  # of a plan, per axis
RADIUS_OFF = 0.05              # mm, at most


@dataclass(frozen=True, eq=False)
class Pair:
    """Hole image and stripe image (h, w) uint8, the truth as `truth.json` has it, the sensor."""

    hole: np.ndarray
    stripe: np.ndarray
    truth: dict
    sensor: object


def render(scene):
    """Render a pair."""
    rng = np.random.default_rng([scene.seed, 2])
    light, lens = look(scene), scene.lens
    face = light.seen == 8 * scene.plate + FACE
    shade = lens.shade(scene.sensor.size)
    ring, room, laser = (lens.blurred(part * shade)
                         for part in (light.ring + light.room, light.room, light.laser))
    gain = scene.grey / np.median(ring[face])
    if scene.clipped:
        gain = WHITE / np.quantile(ring[face], 1.0 - scene.clipped)
    hole = scene.chip.expose(rng, ring * gain)
    peaks = np.where(face, laser, 0.0).max(axis=1)
    power = scene.stripe_grey / max(np.quantile(peaks, 0.6), 1e-12)
    bright = speckled(rng, laser, scene.grain, scene.looks) * power
    stripe = scene.chip.expose(rng, bright + room * (scene.room_grey / np.median(room[face])))
    truth = truth_of(scene, light, laser)
    return Pair(*((stripe, hole) if scene.swapped else (hole, stripe)), truth, scene.sensor)


def truth_of(scene, light, laser):
    """Write what is true of a scene."""
    rng = np.random.default_rng([scene.seed, 3])
    normal = -scene.turn[:, 2]
    tags = set(scene.tags)
    behind = (light.seen // 8 > scene.plate) & (light.seen % 8 == FACE)
    if behind.any() and laser[behind].max() > 0.1 * laser.max():
        tags.add("stripe_in_hole")
    tags |= {"galvanised": {"galv"}, "ecoat_black": {"black"}}.get(scene.finish, set())
    truth = {"sensor": scene.sensor.name, "difficulty": scene.difficulty, "tags": sorted(tags),
             "valid": scene.reason is None, "reason": scene.reason,
             "centre_mm": scene.centre.tolist(), "radius_mm": scene.radius,
             "normal": normal.tolist(),
             "tilt_total_deg": float(np.degrees(np.arccos(-normal[2]))),
             "thickness_mm": scene.thickness, "material": scene.finish,
             "edge_ambiguity_mm": scene.ambiguity, "seed": scene.seed,
             "nominal": nominal_of(rng, scene, normal), **scene.extra}
    if scene.reason:
        truth["note"] = "geometry as rendered; not to be reported by a measuring system"
    return truth


def nominal_of(rng, scene, normal):
    """Give what a plan would say: radius and normal a little off, the thickness right."""
    off = np.clip(rng.normal(0.0, NORMAL_OFF, 2), -2.0 * NORMAL_OFF, 2.0 * NORMAL_OFF)
    leaning = normal + scene.turn[:, :2] @ off
    radius = scene.radius + rng.uniform(-RADIUS_OFF, RADIUS_OFF)
    return {"radius_mm": round(radius, 4),
            "normal": (leaning / np.linalg.norm(leaning)).round(6).tolist(),
            "thickness_mm": scene.thickness}
