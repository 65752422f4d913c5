"""Scenes drawn by a seed: what a robot's sensor meets on car bodies, easy to hard."""

from dataclasses import dataclass, field, replace

import numpy as np

from ray_traced.detector import Chip, Lens
from ray_traced.light import Fan, Lamps, ring, window
from ray_traced.plate import Sheet
from ray_traced.rims import Burr, DieRoll, Round
from ray_traced.sensor import SENSORS, Sensor
from ray_traced.shapes import Beyond, Disc
from ray_traced.surface import FINISHES

TILTS = {"easy": (0.5, 2.0), "medium": (2.0, 5.0), "hard": (5.0, 10.0)}  # degrees
BURR, ROLL = 0.12, 0.15  # mm: the widest
TAGS = ("back", "neighbours", "scratches", "dirt", "spatter", "ambient", "burr", "rollover")
HARDER = ("edge", "clipped", "noise", "small", "ambient", "burr", "rollover", "back")
GREY = {"bare_steel": (105, 165), "galvanised": (95, 140), "ecoat_grey": (75, 170),
        "ecoat_black": (50, 100), "white_primer": (110, 155)}

BEHIND = {"ecoat_grey": 0.4, "ecoat_black": 0.2, "bare_steel": 0.2, "white_primer": 0.1,
          "galvanised": 0.1}


@dataclass(frozen=True)
class SkinPlan:
    """A finish by name, and the marks on it."""

    finish: str
    marks: tuple = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """All that decides a pair; `turn` (3, 3): the plate's axes in the camera frame, as columns."""

    seed: int
    sensor: Sensor
    centre: np.ndarray
    turn: np.ndarray
    radius: float
    sheets: tuple          # from the camera on
    ring: Lamps
    side: Lamps
    sky: float
    fan: Fan | None
    lens: Lens
    chip: Chip
    grey: float            # of the face in the hole image
    clipped: float         # the part of the face that is white there
    stripe_grey: float     # of the stripe's middle
    room_grey: float       # of the face in the stripe image
    grain: float           # of the speckle, px
    looks: int
    difficulty: str
    tags: tuple = ()
    ambiguity: float = 0.0
    reason: str | None = None
    finish: str = ""
    thickness: float = 1.0
    swapped: bool = False
    plate: int = 0         # which of the sheets has the hole
    extra: dict = field(default_factory=dict)


def draw_scene(seed, difficulty=None, tags=None):
    """Draw a valid scene."""
    rng = np.random.default_rng([seed, 1])
    difficulty = difficulty or str(rng.choice(["easy", "medium", "hard"], p=[0.25, 0.45, 0.3]))
    tags = draw_tags(rng, difficulty) if tags is None else tags
    finish = str(rng.choice(list(FINISHES)))
    radius = rng.uniform(2.4, 2.9) if "small" in tags else rng.uniform(3.0, 9.0)
    sensor = SENSORS[rng.integers(len(SENSORS))]
    turn, centre = place(rng, sensor, radius, TILTS[difficulty], 0.65)
    sheet = draw_plate(rng, finish, radius, tags, stripe_in_plate(sensor, turn, centre))
    return finish_scene(rng, seed, sensor, turn, centre, sheet, tags, difficulty)


def draw_tags(rng, difficulty):
    """Draw what makes the scene difficult."""
    if difficulty == "easy":
        return ()
    pool, count = (TAGS, rng.integers(1, 3)) if difficulty == "medium" else (
        HARDER + TAGS, rng.integers(1, 5))
    tags = set(rng.choice(pool, count))
    if {"burr", "rollover"} <= tags:
        tags.discard(str(rng.choice(["burr", "rollover"])))
    return tuple(sorted(map(str, tags)))


def place(rng, sensor, radius, tilts, reach, least=0.0, box=(5.0, 5.0, 5.0)):
    """Draw where the hole is: its axes (3, 3) and centre (3,), the stripe across it.

    The stripe passes the centre at a distance between `least` and `reach` radii, in the plate.
    """
    tilt, bearing = np.radians(rng.uniform(*tilts)), rng.uniform(0.0, 2.0 * np.pi)
    into = np.array([np.sin(tilt) * np.cos(bearing), np.sin(tilt) * np.sin(bearing), np.cos(tilt)])
    across = np.cross([0.0, 1.0, 0.0], into)
    across /= np.linalg.norm(across)
    turn = np.column_stack([across, np.cross(into, across), into])
    normal, offset = sensor.laser_normal
    in_plate = np.linalg.norm(normal - (normal @ into) * into)
    while True:
        centre = rng.uniform(-1.0, 1.0, 3) * box + [0.0, 0.0, -offset / normal[2]]
        aside = abs(normal @ centre + offset) / in_plate / radius
        if least < aside < reach:
            return turn, centre


def draw_plate(rng, finish, radius, tags, stripe):
    """Draw the sheet with the hole in its frame's origin."""
    openings = [Disc(0.0, 0.0, radius)]
    for _ in range(rng.integers(1, 4) if "neighbours" in tags else 0):
        openings += draw_neighbour(rng, openings, stripe)
    if "edge" in tags:
        openings.append(Beyond(rng.uniform(0.0, 2.0 * np.pi), radius + rng.uniform(4.0, 10.0)))
    marks = tuple(tag for tag in tags if tag in ("scratches", "dirt", "spatter"))
    return Sheet(0.0, round(rng.uniform(0.7, 2.0), 2), tuple(openings), SkinPlan(finish, marks),
                 draw_rim(rng, tags))


def draw_neighbour(rng, openings, stripe):
    """Draw another hole that leaves metal between and to the stripe, or none without room."""
    for _ in range(20):
        x, y, radius = rng.uniform(-22, 22), rng.uniform(-18, 18), rng.uniform(2.0, 6.0)
        hole = Disc(x, y, radius)
        apart = stripe[:2] @ [x, y] + stripe[2]
        if abs(apart) > radius + 1.0 and all(
                np.hypot(x - other.x, y - other.y) > radius + other.radius + 2.5
                for other in openings):
            return [hole]
    return []


def stripe_in_plate(sensor, turn, centre):
    """Give the stripe's line in the plate: unit normal and offset (3,), mm."""
    normal, offset = sensor.laser_normal
    line = np.append(normal @ turn[:, :2], normal @ centre + offset)
    return line / np.linalg.norm(line[:2])


def draw_rim(rng, tags):
    """Draw the burr or the die roll, uneven round the hole."""
    phases = rng.uniform(0.0, 2.0 * np.pi, 12)
    if "burr" in tags:
        waves = tuple((order, rng.normal(0.0, 0.25), phases[i])
                      for i, order in enumerate((1, 2, 3, 5, 7, 11, 16, 23, 31)))
        return Burr(Round(rng.uniform(0.3, 0.7) * BURR, waves, BURR), rng.uniform(0.4, 1.2))
    if "rollover" in tags:
        waves = ((1, rng.uniform(0.0, 0.5), phases[0]), (2, rng.uniform(0.0, 0.2), phases[1]))
        even = rng.random() < 0.4
        return DieRoll(Round(rng.uniform(0.4, 0.9) * ROLL, () if even else waves, ROLL))
    return None


def draw_behind(rng, sheet):
    """Draw a second sheet behind."""
    return Sheet(sheet.back + rng.uniform(1.0, 30.0), 1.0, (),
                 SkinPlan(str(rng.choice(list(BEHIND), p=list(BEHIND.values())))))


def draw_fan(rng, sensor, centre):
    """Draw the laser: its source in the light plane, beside the lens."""
    normal, offset = sensor.laser_normal
    y, z = rng.uniform(-6.0, 6.0), rng.uniform(-10.0, 25.0)
    source = np.array([-(offset + normal[1] * y + normal[2] * z) / normal[0], y, z])
    aim = centre - source
    aim -= (aim @ normal) * normal
    return Fan(source, aim / np.linalg.norm(aim), normal, offset, rng.uniform(0.065, 0.12),
               np.radians(rng.uniform(7.0, 20.0)))


def finish_scene(rng, seed, sensor, turn, centre, sheet, tags, difficulty, **changes):
    """Add lights, lens and chip to a plate."""
    finish, noisy = sheet.skin.finish, "noise" in tags
    sheets = (sheet, draw_behind(rng, sheet)) if "back" in tags else (sheet,)
    ambient = "ambient" in tags
    scene = Scene(
        seed=seed, sensor=sensor, centre=np.round(centre, 4), turn=turn,
        radius=sheet.openings[0].radius, sheets=sheets,
        ring=ring(rng.uniform(32.0, 60.0), rng.uniform(0.0, 40.0), int(rng.choice([16, 24, 32]))),
        side=window(rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(25.0, 60.0)),
                    rng.uniform(0.2, 0.6) if ambient else rng.uniform(0.0, 0.1)),
        sky=rng.uniform(0.02, 0.1), fan=draw_fan(rng, sensor, centre),
        lens=Lens(rng.uniform(0.7, 1.6), float(rng.choice([0.0, 0.5])), rng.uniform(0.0, 0.2)),
        chip=Chip(rng.uniform(8, 15) if noisy else rng.uniform(30.0, 60.0),
                  rng.uniform(1.8, 3.0) if noisy else rng.uniform(0.6, 1.5),
                  rng.uniform(2.0, 5.5)),
        grey=rng.uniform(*GREY[finish]),
        clipped=rng.uniform(0.03, 0.3) if "clipped" in tags else 0.0,
        stripe_grey=rng.uniform(90.0, 210.0),
        room_grey=rng.uniform(12.0, 40.0) if ambient else rng.uniform(1.0, 8.0),
        grain=rng.uniform(0.35, 0.6), looks=int(rng.uniform(2.0, 4.5) ** 2), difficulty=difficulty,
        tags=tags, finish=finish, thickness=sheet.thickness,
        ambiguity={"Burr": BURR, "DieRoll": ROLL}.get(type(sheet.rim).__name__, 0.0))
    return replace(scene, **changes)
