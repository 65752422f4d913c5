"""Scenes that must be refused, each with the reason that a locator should give."""

from dataclasses import replace

import numpy as np

from ray_traced.plate import Sheet
from ray_traced.scene import Label, SkinPlan
from ray_traced.scenes import (
    LIKELY_BEHIND,
    MARKS,
    draw_behind,
    draw_plate,
    light_scene,
    place,
    relabel,
    stripe_in_plate,
)
from ray_traced.sensor import SENSORS
from ray_traced.shapes import Beyond, Block, Both, Disc, Join
from ray_traced.surface import FINISHES

LEVEL = (0.5, 5.0)  # degrees
BEHIND = 0.25       # of the pairs show a second sheet


def draw_invalid(seed):
    """Draw a scene that must be refused; the kinds take turns."""
    return KINDS[seed % len(KINDS)](np.random.default_rng([seed, 4]), seed)


def draw_refused(rng, seed, reason, change=None, *, radii=(3.0, 8.0), crossed=(0.0, 0.65)):
    """Draw a plate with a hole; `change` takes the sheets and the stripe and gives other sheets."""
    sensor, radius = SENSORS[rng.integers(len(SENSORS))], rng.uniform(*radii)
    turn, centre = place(rng, sensor, radius, LEVEL, crossed[1], crossed[0])
    stripe = stripe_in_plate(sensor, turn, centre)
    tags = tuple(str(tag) for tag in rng.choice([*MARKS, "ambient", "none"], 1) if tag != "none")
    material = str(rng.choice(list(FINISHES)))
    sheet = draw_plate(rng, material, radius, tags, stripe)
    sheets = (sheet, draw_behind(rng, sheet, material)) if rng.random() < BEHIND else (sheet,)
    plate, sheets = change(sheets, stripe) if change else (0, sheets)
    return light_scene(rng, seed, (sensor, turn, centre, radius), sheets,
                       Label("invalid", tags, material, reason=reason), plate)


def tagged(scene, *tags):
    """Add tags to a scene."""
    return relabel(scene, tags=(*scene.label.tags, *tags))


def opened(shape):
    """Give a change that replaces the hole by the openings `shape(radius, stripe)`."""
    def change(sheets, stripe):
        radius = sheets[0].openings[0].radius
        return 0, (replace(sheets[0], openings=shape(radius, stripe)), *sheets[1:])
    return change


def no_hole(rng, seed):
    return draw_refused(rng, seed, "no_hole", lambda sheets, _: (0, (replace(
        sheets[0], openings=()),)))


def no_laser(rng, seed):
    return replace(draw_refused(rng, seed, "no_laser"), fan=None)


def laser_misses_hole(rng, seed):
    return draw_refused(rng, seed, "laser_misses_hole", radii=(2.5, 5.0), crossed=(1.2, 2.0))


def slot(rng, seed):
    longer, turn = rng.uniform(1.25, 2.5), rng.uniform(0.0, np.pi)
    return draw_refused(rng, seed, "slot", opened(lambda radius, _: (
        Block(0.0, 0.0, radius * longer, radius, radius, turn),)), radii=(2.5, 4.5))


def square(rng, seed):
    corner, turn = rng.uniform(0.02, 0.3), rng.uniform(0.0, np.pi)
    return tagged(draw_refused(rng, seed, "not_round", opened(lambda radius, _: (
        Block(0.0, 0.0, radius, radius, radius * corner, turn),))), "square")


def cut_across(rng, radius, stripe):
    """Draw a straight line that leaves half of the hole or a little more, and the stripe in it."""
    while True:
        rest = Beyond(rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.4, 0.1) * radius)
        if rest.distance(-stripe[2] * stripe[:2]) < -0.3 * radius:
            return rest


def d_shaped(rng, seed):
    return tagged(draw_refused(rng, seed, "half_occluded", opened(lambda radius, stripe: (
        Both((Disc(0.0, 0.0, radius), cut_across(rng, radius, stripe))),))), "d_shaped")


def covered(rng, seed, *, behind=False):
    """Lay a straight-edged sheet over a part of the hole, a little above it."""
    height = rng.uniform(0.5, 4.0)

    def change(sheets, stripe):
        material = next(name for name in FINISHES if FINISHES[name] is sheets[0].skin.finish)
        rest = cut_across(rng, sheets[0].openings[0].radius, stripe)
        cover = Sheet(-height - 0.8, 0.8, (rest,),
                      SkinPlan(FINISHES[str(rng.choice(LIKELY_BEHIND[material]))]))
        under = (sheets[0], draw_behind(rng, sheets[0], material)) if behind else sheets[:1]
        return 1, (cover, *under)

    return tagged(draw_refused(rng, seed, "half_occluded", change), "cover")


def covered_and_lit(rng, seed):
    return tagged(covered(rng, seed, behind=True), "back")


def cut_by_border(rng, seed):
    scene = draw_refused(rng, seed, "hole_cut_by_border", radii=(4.0, 9.0))
    side = rng.choice([0.0, scene.sensor.size[1] - 1.0])
    y = (side - scene.sensor.centre[1]) / scene.sensor.focal[1] * scene.centre[2]
    centre = scene.centre * [1.0, 0.0, 1.0] + [0.0, y + rng.uniform(-0.7, 0.7) * scene.radius, 0.0]
    return replace(scene, centre=centre.round(4))


def exposed(scene, **changes):
    """Give the scene with another exposure."""
    return replace(scene, exposure=replace(scene.exposure, **changes))


def too_dark(rng, seed):
    return exposed(draw_refused(rng, seed, "too_dark"), face=rng.uniform(1.0, 4.0))


def saturated(rng, seed):
    return exposed(draw_refused(rng, seed, "saturated"), clipped=rng.uniform(0.995, 0.9999))


def blurred(rng, seed):
    scene = draw_refused(rng, seed, "blurred")
    return replace(scene, lens=replace(scene.lens, blur=rng.uniform(5.0, 9.0)))


def images_swapped(rng, seed):
    return replace(draw_refused(rng, seed, "images_swapped"), swapped=True)


def stepped(rng, seed):
    """Let one half of the sheet stand higher: a hole where two sheets of a joint meet."""
    height = rng.uniform(0.4, 1.5)
    turn = rng.choice([0.5, 1.5]) * np.pi + rng.normal(0.0, 0.2)

    def change(sheets, _):
        hole = sheets[0].openings[0]
        return 1, (replace(sheets[0], front=-height, thickness=height,
                           openings=(Join((hole, Beyond(turn, 0.0))),)), *sheets)

    return tagged(draw_refused(rng, seed, "stripe_segments_disagree", change,
                               radii=(3.5, 8.0), crossed=(0.0, 0.4)), "step")


KINDS = (no_hole, no_laser, laser_misses_hole, slot, square, d_shaped, covered, covered_and_lit,
         cut_by_border, too_dark, saturated, blurred, images_swapped, stepped)
