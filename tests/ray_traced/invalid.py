"""Scenes that must be refused, each with the reason that a locator should give."""

from dataclasses import replace

import numpy as np

from ray_traced.plate import Sheet
from ray_traced.scenes import (
    SkinPlan,
    draw_behind,
    draw_plate,
    finish_scene,
    place,
    stripe_in_plate,
)
from ray_traced.sensor import SENSORS
from ray_traced.shapes import Beyond, Block, Both, Disc, Join
from ray_traced.surface import FINISHES

LEVEL = (0.5, 5.0)  # degrees


def draw_invalid(seed):
    """Draw a scene that must be refused; the kinds take turns."""
    kind = KINDS[seed % len(KINDS)]
    return replace(kind(np.random.default_rng([seed, 4]), seed), difficulty="invalid")


def base(rng, seed, reason, *, radii=(3.0, 8.0), reach=0.65, least=0.0, box=(5.0, 5.0, 5.0),
         openings=None, behind=None, cover=None):
    """Draw a plate with a hole (or other openings, from its radius) and refuse it for a reason."""
    sensor = SENSORS[rng.integers(len(SENSORS))]
    radius = rng.uniform(*radii)
    turn, centre = place(rng, sensor, radius, LEVEL, reach, least, box)
    marks = tuple(str(tag) for tag in rng.choice(["scratches", "dirt", "ambient", "none"], 1))
    sheet = draw_plate(rng, str(rng.choice(list(FINISHES))), radius, marks,
                       stripe_in_plate(sensor, turn, centre))
    stack = sheet if openings is None else replace(sheet, openings=openings(radius))
    sheets = [stack]
    if behind if behind is not None else rng.random() < 0.25:
        sheets.append(draw_behind(rng, sheet))
    if cover is not None:
        sheets.insert(0, cover(sheet, radius))
    tags = tuple(tag for tag in marks if tag != "none")
    scene = finish_scene(rng, seed, sensor, turn, centre, sheet, tags, "invalid",
                         sheets=tuple(sheets), plate=sheets.index(stack))
    return replace(scene, reason=reason, tags=(*tags, reason))


def no_hole(rng, seed):
    return base(rng, seed, "no_hole", openings=lambda radius: (), behind=False)


def no_laser(rng, seed):
    return replace(base(rng, seed, "no_laser"), fan=None)


def laser_misses_hole(rng, seed):
    return base(rng, seed, "laser_misses_hole", radii=(2.5, 5.0), least=1.2, reach=2.0)


def slot(rng, seed):
    length, turn = rng.uniform(1.25, 2.5), rng.uniform(0.0, np.pi)
    return base(rng, seed, "slot", radii=(2.5, 4.5), openings=lambda radius: (
        Block(0.0, 0.0, radius * length, radius, radius, turn),))


def square(rng, seed):
    corner, turn = rng.uniform(0.02, 0.3), rng.uniform(0.0, np.pi)
    scene = base(rng, seed, "not_round", openings=lambda radius: (
        Block(0.0, 0.0, radius, radius, radius * corner, turn),))
    return replace(scene, tags=(*scene.tags, "square"))


def d_shaped(rng, seed):
    turn, part = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.3, 0.5)
    scene = base(rng, seed, "half_occluded", openings=lambda radius: (
        Both((Disc(0.0, 0.0, radius), Beyond(turn, -part * radius))),))
    return replace(scene, tags=(*scene.tags, "d_shaped"))


def covered(rng, seed, *, behind=False):
    """Lay a straight-edged sheet over a part of the hole, a little above it."""
    turn, part = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.4, 0.4)
    height, finish = rng.uniform(0.5, 4.0), str(rng.choice(list(FINISHES)))
    return base(rng, seed, "half_occluded", behind=behind, cover=lambda sheet, radius: Sheet(
        -height - 0.8, 0.8, (Beyond(turn, -part * radius),), SkinPlan(finish)))


def covered_and_lit(rng, seed):
    scene = covered(rng, seed, behind=True)
    return replace(scene, tags=(*scene.tags, "back"))


def cut_by_border(rng, seed):
    scene = base(rng, seed, "hole_cut_by_border", radii=(4.0, 9.0))
    height, fy = scene.sensor.size[1], scene.sensor.focal[1]
    side = rng.choice([0.0, height - 1.0])
    y = (side - scene.sensor.centre[1]) / fy * scene.centre[2]
    centre = scene.centre.copy()
    centre[1] = y + rng.uniform(-0.7, 0.7) * scene.radius
    return replace(scene, centre=np.round(centre, 4))


def too_dark(rng, seed):
    return replace(base(rng, seed, "too_dark"), grey=rng.uniform(1.0, 4.0))


def saturated(rng, seed):
    return replace(base(rng, seed, "saturated"), clipped=rng.uniform(0.995, 0.9999))


def blurred(rng, seed):
    scene = base(rng, seed, "blurred")
    return replace(scene, lens=replace(scene.lens, blur=rng.uniform(5.0, 9.0)))


def images_swapped(rng, seed):
    return replace(base(rng, seed, "images_swapped"), swapped=True)


def stepped(rng, seed):
    """Let one half of the sheet stand higher: a hole through two sheets that meet in it."""
    height = rng.uniform(0.4, 1.5)
    turn = rng.choice([0.5, 1.5]) * np.pi + rng.normal(0.0, 0.2)
    return base(rng, seed, "stripe_segments_disagree", radii=(3.5, 8.0), reach=0.4,
                cover=lambda sheet, radius: replace(
                    sheet, front=-height, thickness=height,
                    openings=(Join((Disc(0.0, 0.0, radius), Beyond(turn, 0.0))),)))


KINDS = (no_hole, no_laser, laser_misses_hole, slot, square, d_shaped, covered, covered_and_lit,
         cut_by_border, too_dark, saturated, blurred, images_swapped, stepped)
