"""What calibrating is worth: hand-eye over 40 seeds, 50 views in time, and the whole chain."""

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from made_arms import StudyWorld
from made_sessions import SMALL, WIDE, World, plain_reprojection, plan

from cell.metrology.calibrate.hand_eye.solve import solve_hand_eye
from cell.metrology.calibrate.hand_eye.start import solve_park
from cell.metrology.calibrate.kinematics import solve_kinematics

pytestmark = [pytest.mark.bench, pytest.mark.timeout(900)]
SEEDS = 40
ROOT = Path(__file__).parents[2]


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("camera", [WIDE, SMALL], ids=["2448x2048", "768x576"])
@pytest.mark.parametrize(("count", "planned", "limit"),
                         [(15, False, 0.075), (10, True, 0.065)], ids=["15 random", "10 planned"])
def test_point_error(camera, count, planned, limit):
    world = World(camera=camera)
    error = {"ML": [], "predicted": [], "Park": [], "reprojection": []}
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        poses = plan(world, rng, count) if planned else None
        session = world.session(rng, count, poses)
        problem = session.problem()
        result = solve_hand_eye(problem)
        park = solve_park(problem.reference_from_carrier, problem.camera_from_board)
        error["ML"].append(world.point_error(result.carrier_from_camera))
        error["predicted"].append(result.point_sigma(250.0))
        error["Park"].append(world.point_error(park))
        error["reprojection"].append(world.point_error(plain_reprojection(session)))
    figures = {name: rms(values) for name, values in error.items()}
    print(f"\n{camera.image_size[0]} px, {count} poses, planned {planned}: "
          + ", ".join(f"{name} {value:.4f} mm" for name, value in figures.items()))
    assert 0.8 <= figures["predicted"] / figures["ML"] <= 1.25
    assert figures["ML"] <= 1.1 * figures["Park"]
    if camera is WIDE:
        assert figures["ML"] <= limit
    if camera is WIDE and not planned:
        assert figures["reprojection"] >= 1.8 * figures["ML"]


def test_the_arms_own_rows_take_holes_from_half_a_millimetre_to_its_repeatability():
    """The study's figures: 0.52 mm rms with the published rows, 0.13 with those estimated."""
    missed = {"published": [], "estimated": [], "repeatability": []}
    for seed in range(16):
        world = StudyWorld(seed)
        mount = world.hand_eye()
        result = solve_kinematics(world.views, world.nominal, mount)
        missed["published"].append(world.holes_missed_by(world.nominal, mount))
        missed["estimated"].append(world.holes_missed_by(result.arm, result.flange_from_camera))
        missed["repeatability"].append(world.holes_missed_by(world.true, world.mounted))
    figures = {name: rms(values) for name, values in missed.items()}
    print("\nkinematics, asked 0.52 -> 0.13 mm: "
          + ", ".join(f"{name} {value:.3f} mm" for name, value in figures.items()))
    assert 0.4 <= figures["published"] <= 0.65
    assert figures["estimated"] <= 0.13


def test_fifty_views_in_a_second_of_one_core():
    problem = World().session(np.random.default_rng(1), 50).problem()
    begun = time.process_time()
    solve_hand_eye(problem)
    spent = time.process_time() - begun
    print(f"\n50 views: {1000 * spent:.0f} ms")
    assert spent < 1.0


@pytest.mark.parametrize("arm", ["ideal", "default"])
def test_the_whole_chain_on_the_virtual_cell(arm, tmp_path):
    """Camera, light plane, hand-eye and body from nothing, then a body measured against the truth.
    """
    for name in ("jobs", "calibration"):
        shutil.copytree(ROOT / name, tmp_path / name)
    if arm == "ideal":
        make_arm_ideal(tmp_path / "calibration" / "demo" / "scene.yaml")
    (tmp_path / "plan.yaml").write_text("reason: the bench accepts warnings\n")
    call(tmp_path, "calibrate", "all", "--plan", "plan.yaml", "--yes", "--speed", "10")
    call(tmp_path, "calibrate", "body", "jobs/demo.yaml", "--yes", "--speed", "10",
         "--reason", "the bench")
    answer = json.loads(call(tmp_path, "run", "jobs/demo.yaml", "--speed", "10", "--truth",
                             "truth.json", "--json", good=(0, 1)))
    off, sigma = deviations(answer, json.loads((tmp_path / "truth.json").read_text()))
    print(f"\n{arm} arm: mean {off.mean(axis=0).round(4)}, sd {off.std(axis=0).round(4)}, "
          f"largest {np.abs(off).max(axis=0).round(3)} mm of {len(off)} holes")
    assert len(off) >= 20
    assert np.mean(np.abs(off) <= 2.0 * sigma) >= 0.9
    if arm == "ideal":
        assert np.abs(off.mean(axis=0)).max() < 0.05


def make_arm_ideal(scene):
    text = scene.read_text()
    for key in ("length_mm", "angle_deg", "hysteresis_deg", "repeatability_deg", "sway_deg",
                "cold_mm"):
        text, found = re.subn(rf"^(  {key}:) .*$", r"\1 0.0", text, flags=re.MULTILINE)
        assert found == 1, key
    scene.write_text(text)


def call(folder, *words, good=(0,)):
    done = subprocess.run([sys.executable, "-m", "cell", *words], cwd=folder, text=True,
                          capture_output=True, check=False, timeout=600)
    assert done.returncode in good, done.stderr[-2000:]
    return done.stdout


def deviations(answer, truth):
    centres = {hole["id"]: hole["centre_mm"] for hole in truth["holes"]}
    seen = [feature for feature in answer["features"] if feature["measured_mm"]]
    off = [[feature["measured_mm"][axis] - centre for axis, centre in
            zip("xyz", centres[feature["id"]], strict=True)] for feature in seen]
    sigma = [[feature["uncertainty_mm"][axis] for axis in "xyz"] for feature in seen]
    return np.array(off), np.array(sigma)
