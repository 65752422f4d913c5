"""Scenes drawn by a seed: what a robot's sensor meets on car bodies, easy to hard."""

from dataclasses import replace

import numpy as np

from ray_traced.detector import Chip, Lens
from ray_traced.light import Fan, ring, window
from ray_traced.plate import Sheet
from ray_traced.rims import Burr, DieRoll, Round
from ray_traced.scene import Exposure, Label, Scene, SkinPlan, Speckle
from ray_traced.sensor import SENSORS
from ray_traced.shapes import Beyond, Disc
from ray_traced.surface import FINISHES

TILTS = {"easy": (0.5, 2.0), "medium": (2.0, 5.0), "hard": (5.0, 10.0)}  # degrees
BURR, ROLL = 0.12, 0.15  # mm: the widest
MARKS = ("scratches", "dirt", "spatter")
TAGS = ("back", "neighbours", "ambient", "burr", "rollover", *MARKS)
HARDER = ("edge", "clipped", "noise", "small", "ambient", "burr", "rollover", "back")
GREY = {"bare_steel": (105, 165), "galvanised": (95, 140), "ecoat_grey": (75, 170),
        "ecoat_black": (50, 100), "white_primer": (110, 155)}
LIKELY_BEHIND = {"bare_steel": ("bare_steel", "galvanised", "ecoat_grey"),
                 "galvanised": ("galvanised", "bare_steel", "ecoat_grey"),
                 "ecoat_grey": ("ecoat_grey",), "ecoat_black": ("ecoat_black",),
                 "white_primer": ("white_primer", "ecoat_grey")}  # a body is dipped as a whole
STRANGER_BEHIND = 0.15


def draw_scene(seed, difficulty=None, tags=None):
    """Draw a valid scene."""
    rng = np.random.default_rng([seed, 1])
    difficulty = difficulty or str(rng.choice(list(TILTS), p=[0.25, 0.45, 0.3]))
    tags = draw_tags(rng, difficulty) if tags is None else tags
    material = str(rng.choice(list(FINISHES)))
    radius = rng.uniform(2.4, 2.9) if "small" in tags else rng.uniform(3.0, 9.0)
    sensor = SENSORS[rng.integers(len(SENSORS))]
    turn, centre = place(rng, sensor, radius, TILTS[difficulty], 0.65)
    sheet = draw_plate(rng, material, radius, tags, stripe_in_plate(sensor, turn, centre))
    sheets = (sheet, draw_behind(rng, sheet, material)) if "back" in tags else (sheet,)
    ambiguity = {Burr: BURR, DieRoll: ROLL}.get(type(sheet.rim), 0.0)
    return light_scene(rng, seed, (sensor, turn, centre, radius), sheets,
                       Label(difficulty, tags, material, ambiguity))


def draw_tags(rng, difficulty):
    """Draw what makes the scene difficult."""
    if difficulty == "easy":
        return ()
    pool, count = (TAGS, rng.integers(1, 3)) if difficulty == "medium" else (
        HARDER + TAGS, rng.integers(1, 5))
    tags = set(map(str, rng.choice(pool, count)))
    if {"burr", "rollover"} <= tags:
        tags.discard(str(rng.choice(["burr", "rollover"])))
    return tuple(sorted(tags))


def place(rng, sensor, radius, tilts, reach, least=0.0):
    """Draw where the hole is: its axes (3, 3) and centre (3,), within 5 mm of the stand-off.

    The stripe passes the centre at a distance between `least` and `reach` radii, in the plate.
    """
    tilt, bearing = np.radians(rng.uniform(*tilts)), rng.uniform(0.0, 2.0 * np.pi)
    into = np.array([np.sin(tilt) * np.cos(bearing), np.sin(tilt) * np.sin(bearing), np.cos(tilt)])
    across = np.cross([0.0, 1.0, 0.0], into)
    across /= np.linalg.norm(across)
    turn = np.column_stack([across, np.cross(into, across), into])
    normal, offset = sensor.laser_normal
    middle = np.array([0.0, 0.0, -offset / normal[2]])
    while True:
        centre = middle + rng.uniform(-5.0, 5.0, 3)
        if least < abs(stripe_in_plate(sensor, turn, centre)[2]) / radius < reach:
            return turn, centre.round(4)


def stripe_in_plate(sensor, turn, centre):
    """Give the stripe's line in the plate (3,): unit normal and offset from the hole, mm."""
    normal, offset = sensor.laser_normal
    line = np.append(normal @ turn[:, :2], normal @ centre + offset)
    return line / np.linalg.norm(line[:2])


def draw_plate(rng, material, radius, tags, stripe):
    """Draw the sheet with the hole in its frame's origin."""
    openings = [Disc(0.0, 0.0, radius)]
    for _ in range(rng.integers(1, 4) if "neighbours" in tags else 0):
        openings += draw_neighbour(rng, openings, stripe)
    if "edge" in tags:
        openings.append(Beyond(rng.uniform(0.0, 2.0 * np.pi), radius + rng.uniform(4.0, 10.0)))
    skin = SkinPlan(FINISHES[material], tuple(tag for tag in tags if tag in MARKS))
    return Sheet(0.0, round(rng.uniform(0.7, 2.0), 2), tuple(openings), skin, draw_rim(rng, tags))


def draw_neighbour(rng, openings, stripe):
    """Draw another hole that leaves metal between and to the stripe, or none without room."""
    for _ in range(20):
        x, y, radius = rng.uniform(-22, 22), rng.uniform(-18, 18), rng.uniform(2.0, 6.0)
        apart = [np.hypot(x - hole.x, y - hole.y) - hole.radius for hole in openings]
        if min(apart) > radius + 2.5 and abs(stripe @ [x, y, 1.0]) > radius + 1.0:
            return [Disc(x, y, radius)]
    return []


def draw_rim(rng, tags):
    """Draw the burr or the die roll, uneven round the hole."""
    phases = rng.uniform(0.0, 2.0 * np.pi, 9)
    if "burr" in tags:
        waves = tuple((order, rng.normal(0.0, 0.25), phase) for order, phase in
                      zip((1, 2, 3, 5, 7, 11, 16, 23, 31), phases, strict=True))
        return Burr(Round(rng.uniform(0.3, 0.7) * BURR, waves, BURR), rng.uniform(0.6, 1.8))
    if "rollover" in tags:
        waves = ((1, rng.uniform(0.0, 0.5), phases[0]), (2, rng.uniform(0.0, 0.2), phases[1]))
        even = rng.random() < 0.4
        return DieRoll(Round(rng.uniform(0.4, 0.9) * ROLL, () if even else waves, ROLL))
    return None


def draw_behind(rng, sheet, material):
    """Draw a second sheet behind."""
    strange = rng.random() < STRANGER_BEHIND
    finish = str(rng.choice(list(FINISHES) if strange else LIKELY_BEHIND[material]))
    return Sheet(sheet.back + rng.uniform(1.0, 30.0), 1.0, (), SkinPlan(FINISHES[finish]))


def draw_fan(rng, sensor, centre):
    """Draw the laser: its source in the light plane, beside the lens."""
    normal, offset = sensor.laser_normal
    y, z = rng.uniform(-6.0, 6.0), rng.uniform(-10.0, 25.0)
    source = np.array([-(offset + normal[1] * y + normal[2] * z) / normal[0], y, z])
    aim = centre - source
    aim -= (aim @ normal) * normal
    return Fan(source, aim / np.linalg.norm(aim), normal, offset, rng.uniform(0.065, 0.12),
               np.radians(rng.uniform(7.0, 20.0)))


def draw_side(rng, ambient):
    """Draw the side light: a window somewhere, weak unless the place is light."""
    return window(rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(25.0, 60.0)),
                  rng.uniform(0.2, 0.6) if ambient else rng.uniform(0.0, 0.1))


def draw_chip(rng, noisy):
    """Draw the chip: noisy is with much gain, after a short exposure."""
    return Chip(rng.uniform(8.0, 15.0) if noisy else rng.uniform(30.0, 60.0),
                rng.uniform(1.8, 3.0) if noisy else rng.uniform(0.6, 1.5), rng.uniform(2.0, 5.5))


def draw_exposure(rng, label):
    """Draw how bright the pictures are."""
    return Exposure(rng.uniform(*GREY[label.material]), rng.uniform(90.0, 210.0),
                    rng.uniform(12.0, 40.0) if "ambient" in label.tags else rng.uniform(1.0, 8.0),
                    rng.uniform(0.03, 0.3) if "clipped" in label.tags else 0.0)


def light_scene(rng, seed, seen, sheets, label, plate=0):
    """Add lights, lens and chip to sheets; `seen`: sensor, turn, centre and radius."""
    sensor, turn, centre, radius = seen
    return Scene(
        seed, sensor, centre, turn, radius, sheets, plate,
        ring=ring(rng.uniform(32.0, 60.0), rng.uniform(0.0, 40.0), int(rng.choice([16, 24, 32]))),
        side=draw_side(rng, "ambient" in label.tags), sky=rng.uniform(0.02, 0.1),
        fan=draw_fan(rng, sensor, centre),
        lens=Lens(rng.uniform(0.7, 1.6), float(rng.choice([0.0, 0.5])), rng.uniform(0.0, 0.2)),
        chip=draw_chip(rng, "noise" in label.tags), exposure=draw_exposure(rng, label),
        speckle=Speckle(rng.uniform(0.35, 0.6), int(rng.uniform(2.0, 4.5) ** 2)), label=label)


def relabel(scene, **changes):
    """Give the scene with changes to its label."""
    return replace(scene, label=replace(scene.label, **changes))
