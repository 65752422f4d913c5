"""A board in two places, an arm whose rows are off: the wizard finds them, and measuring gains."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_operator import Scripted
from scipy.spatial.transform import Rotation

from cell.core.documents.calibration_session import CalibrationPlan
from cell.core.kinematics import arm_for
from cell.metrology.motions import lay_onto
from cell.programs.calibration.belief import read_belief
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.check import CheckRequest, check_cell
from cell.programs.calibration.wizard import Request, run_wizard
from cell.programs.inspection import prepare
from cell.sim.scene import read_scene
from cell.sim.world import draw_world

ROOT = Path(__file__).parents[2]
PLAN = CalibrationPlan(views=16, views_elsewhere=14, early_stop=False, sphere_views=6,
                       reason="a trial")
FROM, TO, TURN = np.array([614.0, -588.0, 14.0]), np.array([600.0, 0.0, 200.0]), 48.0  # mm, deg


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """The demo cell with a second board, and an arm four times as far off."""
    folder = shutil.copytree(ROOT / "calibration", tmp_path_factory.mktemp("two") / "calibration")
    targets, scene = folder / "demo" / "targets.yaml", folder / "demo" / "scene.yaml"
    for file, name in ((targets, "id"), (scene, "name")):
        text = file.read_text()
        board = yaml.safe_load(text)["boards"][0]
        board = board | {name: "wall", "base_from_board": carried(board["base_from_board"])}
        text = text.replace("\nspheres:", f"\n  - {json.dumps(board)}\nspheres:")
        text = text.replace("length_mm: 0.025", "length_mm: 0.1")
        file.write_text(text.replace("angle_deg: 0.004", "angle_deg: 0.015"))
    return folder


def carried(rows):
    """Carry a board's place to where the second one stands."""
    board, motion = np.array(rows), np.eye(4)
    motion[:3, :3] = Rotation.from_euler("z", TURN, degrees=True).as_matrix()
    motion[:3, 3] = TO - motion[:3, :3] @ FROM
    return (motion @ board).tolist()


def error(plant, chain):
    """How far (mm, rms) a chain carries the demo's holes wrongly, beyond a rigid motion."""
    world, arm = draw_world(read_scene(plant / "demo" / "scene.yaml")), arm_for("ur10e")
    stops = [stop.joints for stop in prepare(ROOT / "jobs" / "demo.yaml").stops]
    ahead = np.array([0.0, 0.0, 242.0])
    true = np.array([world.arm.warm.forward(q) @ world.flange_from_camera @ ahead for q in stops])
    ours = np.array([chain.base_from_camera(arm.forward(q), q) @ ahead for q in stops])
    gap = lay_onto(ours, true) @ ours - true
    return float(np.sqrt(np.mean(np.sum(gap ** 2, axis=1))))


@pytest.mark.bench
@pytest.mark.timeout(900)
def test_views_in_two_places_find_the_rows_of_the_arm(plant):
    operator = Scripted({"at all?": "all"})
    done = run_wizard(Request("hand-eye", "demo", PLAN, plant, speed=15.0), operator)
    belief = read_belief(plant, "demo")
    found = done.solution.kinematics
    assert operator.heard("Look at one board (table) or at all?") and found.places == 2
    assert done.active and found.useful and belief.kinematics == found.document
    with_rows = error(plant, belief.chain)
    without = error(plant, Chain(draw_world(read_scene(
        plant / "demo" / "scene.yaml")).flange_from_camera))
    print(f"\nholes beyond a rigid motion: {with_rows:.3f} mm with the arm's rows, "
          f"{without:.3f} mm without and with the true mount; views apart "
          f"{found.apart_with:.3f} against {found.apart_without:.3f} mm")
    assert with_rows < 0.5 * without
    check = check_cell(CheckRequest("demo", plant, speed=15.0), Scripted())
    gates = {gate.name: gate for gate in check.gates}
    assert gates["spread_mm"].value < 0.15 and not check.refused
