"""What the estimate reaches on point data: against the Cramér-Rao bound, and in two scenarios.

S3: a plan's tilt of 6 and 3 degrees, known to 0.5; S4: tilts of N(0, 1.2) degrees that no plan
knows. Both with edges of 0.1 px, stripes of 0.2 px, form of 4 um and a stripe bias of 0.05 px.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from made_points import SENSOR_B, TAN, L, Noise, TrueHole, make_pair, make_stripe, tilted, waver
from rich.console import Console
from rich.table import Table

from cell.core.geometry import Transform
from cell.metrology.features import Expected
from cell.metrology.locate.joint import locate_joint
from cell.metrology.locate.two_step import locate_two_step

pytestmark = pytest.mark.bench

TRIALS = 300
SAME = Transform.identity()
PLANE, CAMERA = SENSOR_B.light_plane, SENSOR_B.camera
INCREMENT = 0.05  # mm: how exactly an arm goes where it is sent
POSE_SIGMA = 0.02  # mm: how exactly it knows where it went
BOX = 5.0


@dataclass(frozen=True)
class Scenario:
    """Noise, the plan's normal, and how well it is known (degrees per axis)."""

    noise: Noise
    plan_deg: tuple[float, float]
    sigma_deg: float


PURE = Scenario(Noise(0.05, 0.1), (0.0, 0.0), 0.7)
S3 = Scenario(Noise(0.1, 0.2, 0.004, 0.05), (6.0, 3.0), 0.5)
S4 = Scenario(Noise(0.1, 0.2, 0.004, 0.05), (0.0, 0.0), 1.2)


class Trial:
    """One hole: as it is met first, and after the camera has moved so that it is centred."""

    def __init__(self, scenario, radius, rng, reach=0.75):
        self.scenario, self.rng, self.sigma = scenario, rng, np.radians(scenario.sigma_deg)
        plan = tilted(*scenario.plan_deg)
        normal = waver(plan, self.sigma, rng)
        while True:
            self.met = TrueHole(np.array([0, 0, L]) + rng.uniform(-BOX, BOX, 3), normal, radius)
            if abs(self.met.distance(PLANE)) < reach * radius:
                break
        self.centred = replace(self.met, centre=np.array([0, 0, L]) + rng.normal(0, INCREMENT, 3))
        self.plan = Expected(normal=plan, normal_sigma=self.sigma,
                             radius=radius + rng.normal(0, 0.03))

    def error(self, hole, located):
        return np.append(located.centre - hole.centre, located.radius - hole.radius)

    def two_step(self):
        rim, stripe = make_pair(self.met, SENSOR_B, self.scenario.noise, self.rng)
        return self.error(self.met, locate_two_step(rim, stripe, SENSOR_B, self.plan))

    def single_shot(self):
        rim, stripe = make_pair(self.met, SENSOR_B, self.scenario.noise, self.rng)
        return self.error(self.met, locate_joint(rim, [(stripe, SAME)], SENSOR_B, self.plan))

    def recentred(self, with_first=True):
        noise = self.scenario.noise
        rim, stripe = make_pair(self.centred, SENSOR_B, noise, self.rng)
        first = make_stripe(self.met, SENSOR_B, noise, self.rng)
        way = self.centred.centre - self.met.centre
        known = Transform.from_parts(np.zeros(3), way + self.rng.normal(0, POSE_SIGMA, 3))
        bias = np.hypot(first.bias, POSE_SIGMA * CAMERA.matrix[0, 0] * TAN / L)
        shots = [(stripe, SAME), (replace(first, bias=float(bias)), known)]
        return self.error(self.centred, locate_joint(rim, shots[:1 + with_first], SENSOR_B,
                                                     self.plan))


def run(what, scenario, radius, reach=0.75, trials=TRIALS):
    """Errors (trials, 4) in micrometres."""
    rng = np.random.default_rng(100)
    return 1e3 * np.array([what(Trial(scenario, radius, rng, reach)) for _ in range(trials)])


def rms(errors):
    """The 3D rms of the centre's error."""
    return float(np.sqrt(np.sum(errors[:, :3] ** 2, axis=1).mean()))


def show(capsys, title, head, rows):
    table = Table(*head, title=title)
    for row in rows:
        table.add_row(*(cell if isinstance(cell, str) else f"{cell:.2f}" for cell in row))
    with capsys.disabled():
        Console(width=110).print(table)


def bound(radius, noise):
    """The Cramér-Rao bound with a known normal: std of x, y, z in micrometres."""
    mm_per_px = L / CAMERA.matrix[0, 0]
    rim, stripe = 2 * np.pi * radius / mm_per_px, 2 * 10.0 / mm_per_px
    across = mm_per_px * noise.edge / np.sqrt(rim / 2)
    return 1e3 * np.array([across, across, mm_per_px / TAN * noise.stripe / np.sqrt(stripe)])


@pytest.mark.parametrize("radius", [3.0, 5.0])
def test_noise_alone_against_the_bound(radius, capsys):
    """Asked: 3D rms of the re-centred estimate at most 1.5 times the bound, z at most 1.15."""
    errors = run(Trial.recentred, PURE, radius)
    least = bound(radius, PURE.noise)
    ratio = rms(errors) / np.linalg.norm(least)
    ratio_z = np.sqrt(np.mean(errors[:, 2] ** 2)) / least[2]
    alone = run(lambda trial: trial.recentred(with_first=False), PURE, radius)
    show(capsys, f"Noise only, r = {radius:g} mm, re-centred (um)",
         ("", "3D rms", "bound", "ratio", "asked", "z ratio", "asked"),
         [("with the first stripe", rms(errors), np.linalg.norm(least), ratio, 1.5, ratio_z, 1.15),
          ("without it", rms(alone), np.linalg.norm(least), rms(alone) / np.linalg.norm(least), "",
           np.sqrt(np.mean(alone[:, 2] ** 2)) / least[2], "")])
    assert ratio < 1.5
    assert ratio_z < 1.15


def test_s4_with_an_unknown_tilt(capsys):
    """Asked: at most 16 um with the body predicted, 12 um re-centred; plain about 46 um."""
    plain, single = run(Trial.two_step, S4, 5.0), run(Trial.single_shot, S4, 5.0)
    predicted = run(Trial.single_shot, S4, 5.0, reach=0.7 / 5.0)
    centred = run(Trial.recentred, S4, 5.0)
    show(capsys, "S4, r = 5 mm: 3D rms (um)", ("", "reached", "asked"),
         [("plain two-step", rms(plain), "about 46"), ("joint, single shot", rms(single), ""),
          ("joint, body predicted", rms(predicted), "16"),
          ("joint, re-centred", rms(centred), "12")])
    assert rms(predicted) < 16.0
    assert rms(centred) < 12.0


def test_s3_with_a_known_tilt(capsys):
    """Asked: at most 25 um from a single shot; plain about 314 um."""
    plain, single = run(Trial.two_step, S3, 10.0), run(Trial.single_shot, S3, 10.0)
    show(capsys, "S3, r = 10 mm: 3D rms (um)", ("", "reached", "asked"),
         [("plain two-step", rms(plain), "about 314"), ("joint, single shot", rms(single), "25")])
    assert rms(single) < 25.0
