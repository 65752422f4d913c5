"""The wizard on the virtual cell, whose truth differs from what the active set believes."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_boards import LENS, TRUTH, sharp_rim
from made_operator import Scripted
from made_scenes import demo_scene, demo_world

from cell.archive.activation import history
from cell.archive.files import read_text
from cell.archive.sets import active_set, check_set, read_set
from cell.core.documents.calibration import HandEyeDocument, SensorDocument
from cell.core.documents.calibration_session import CalibrationPlan
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.metrology.detect.band import SMOOTHING
from cell.metrology.detect.hole import detect_hole
from cell.metrology.features import Expected
from cell.programs.calibration.belief import read_belief
from cell.programs.calibration.check import CheckRequest, check_cell
from cell.programs.calibration.last_set import with_last_set
from cell.programs.calibration.make_set import sensor_document
from cell.programs.calibration.session import Session
from cell.programs.calibration.shown import Shown
from cell.programs.calibration.solve import before_and_after, solve_session
from cell.programs.calibration.wizard import Request, conclude, run_wizard

ROOT = Path(__file__).parents[2]
PLAN = CalibrationPlan(views=13, hold_out=3, sphere_views=6, reason="a trial")
pytestmark = pytest.mark.timeout(400)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A cell's folder to spoil."""
    folder = tmp_path_factory.mktemp("plant") / "calibration"
    shutil.copytree(ROOT / "calibration", folder)
    return folder


@pytest.fixture(scope="module")
def cut_off(plant):
    """A session in which all keys were pressed, the last after eight views."""
    operator = Scripted(keys={"Drive them": "r", "02/22": "p", "04/22": "r", "06/22": "s",
                                                 "08/22": "q"})
    with pytest.raises(DocumentError, match="--resume goes on"):
        run_wizard(Request("all", "demo", PLAN, plant, speed=20.0), operator)
    assert operator.keys == {}
    return operator


@pytest.fixture(scope="module")
def finished(plant, cut_off):
    """The same session, gone on with to its end."""
    sessions = list((plant / "demo" / "sessions").iterdir())
    assert len(sessions) == 1
    with (sessions[0] / "views.jsonl").open("a") as lines:
        lines.write('{"number": 9, "purpose": "fi')  # a line that the crash cut short
    operator = Scripted()
    done = run_wizard(Request("all", "demo", PLAN, plant, speed=20.0, resume=True), operator)
    return done, operator


def chain_error(folder, set_id):
    """How far (mm, rms) pixels of the stripe are carried wrongly to the flange, by the truth."""
    texts = read_set(folder, set_id).texts
    sensor = parse(SensorDocument, texts["sensor"], "sensor").model
    mount = Transform(np.array(parse(HandEyeDocument, texts["hand_eye"], "h").flange_from_camera))
    world = demo_world()
    pixels = np.array([[x, y] for x in (150.0, 384.0, 620.0) for y in (120.0, 288.0, 460.0)])
    true = world.flange_from_camera @ world.sensor.light_plane.meet(
        world.sensor.camera.rays(pixels))
    gap = mount @ sensor.light_plane.meet(sensor.camera.rays(pixels)) - true
    return float(np.sqrt(np.mean(np.sum(gap ** 2, axis=1))))


def test_every_view_is_on_the_disk_when_it_is_told(plant, cut_off):
    session = Session.read(next((plant / "demo" / "sessions").iterdir()))
    status = {view.number: view.status for view in session.views}
    assert status == dict.fromkeys(range(1, 9), "ok") | {7: "skipped by the operator"}
    assert cut_off.heard("squares measured by CMM")
    assert cut_off.heard("corners ") and cut_off.heard("| predicted 0.")


def test_it_goes_on_where_it_was_cut_off(finished):
    done, operator = finished
    assert operator.heard("7 views are there")
    assert not operator.heard("01/22") and not operator.heard("07/22") and operator.heard("22/22")
    assert len({view.number for view in Session.read(done.session).views}) == 22


def test_keys_between_views_pause_retake_and_skip(plant, cut_off):
    said = "\n".join(cut_off.said)
    assert said.index("02/22") < said.index("the lights are off") < said.index("03/22")
    session = Session.read(next((plant / "demo" / "sessions").iterdir()))
    assert session.takes(4) == 2 and [session.takes(number) for number in (1, 2, 3, 5)] == [1] * 4
    assert (session.folder / "images" / "0004_board.png").exists()
    assert next(v for v in session.views if v.number == 4).ring == "images/0004-2_board.png"
    assert "07/22 skipped: by the operator" in said
    for view in session.views:
        if view.status == "ok":  # none was taken on the way to another
            planned = session.header.numbered[view.number].joints
            assert view.joints == pytest.approx(planned, abs=0.01)


def test_the_sphere_checks_the_way_through_the_laser(plant, finished):
    solution = finished[0].solution
    gates = {gate.name: gate for gate in solution.gates["sphere"]}
    assert gates["poses"].value == 6 and gates["spread_mm"].value < 0.15
    assert gates["radius_off_mm"].verdict == "pass"
    assert solution.sphere.centre == pytest.approx(demo_scene().spheres[0].centre, abs=0.4)
    report = read_text(plant / "demo" / "sets" / finished[0].set_id / "report.html")
    assert "the poses disagree about the sphere" in report


def test_the_set_is_better_than_what_it_began_with(plant, finished):
    done, _ = finished
    folder = plant / "demo"
    assert done.solution.verdict in ("pass", "warn") and done.active
    assert active_set(folder) == done.set_id
    assert chain_error(folder, done.set_id) < 0.12 < chain_error(folder, "2026-11-20a")
    before, after = before_and_after(done.solution, read_belief(ROOT / "calibration", "demo"))
    assert np.median(after) < 0.6 * np.median(before)
    assert [gate.name for gate in done.solution.gates["last set"]] == [
        "hand_eye", "light_plane", "focal", "blur_percent"]
    assert [line.set for line in history(folder)] == ["2026-11-20a", done.set_id]


def test_the_set_is_whole_and_carries_its_evidence(plant, finished):
    done, _ = finished
    home = plant / "demo" / "sets" / done.set_id
    check_set(home)
    report = read_text(home / "report.html")
    for title in ("Coverage of the image", "Light plane", "Tilt and roll", "Residuals", "The board "
                  "in all views", "Before and after", "Uncertainty at the", "Sphere"):
        assert f"<strong>{title}" in report
    assert report.count("data:image/png;base64") == 8
    assert len(list((home / "images").glob("*.png"))) >= 30
    document = parse(HandEyeDocument, read_text(home / "hand_eye.yaml"), "hand_eye")
    assert document.robot.kinematics_checksum and document.covariance is not None
    sensor = parse(SensorDocument, read_text(home / "sensor.yaml"), "sensor")
    assert sensor.camera_covariance and sensor.light_plane_covariance


def test_the_set_knows_how_soft_a_sharp_edge_is(plant, finished):
    done, operator = finished
    home = plant / "demo" / "sets" / done.set_id
    blur = parse(SensorDocument, read_text(home / "sensor.yaml"), "sensor").blur
    rng = np.random.default_rng(2)
    rims = [detect_hole(sharp_rim(LENS, rng), TRUTH.camera, Expected(radius=5.0, thickness=1.0))
            for _ in range(3)]
    assert np.sqrt(np.array([rim.blur for rim in rims])**2 - SMOOTHING**2) == pytest.approx(
        blur, rel=0.03)
    gates = {gate.name: gate for gate in done.solution.gates["camera"]}
    assert gates["blur_px"].value == blur and gates["blur_spread_percent"].value < 1.0
    assert operator.heard(f"a sharp edge is {blur:.3f} px soft")
    assert f"a sharp edge is {blur:.3f} px soft" in read_text(home / "report.html")


def test_a_set_that_does_not_know_it_can_be_begun_with_and_made(finished):
    solution, belief = finished[0].solution, read_belief(ROOT / "calibration", "demo")
    before = replace(belief, sensor_document=belief.sensor_document.model_copy(
        update={"blur": None}))
    names = [gate.name for gate in with_last_set(solution, before, "fine").gates["last set"]]
    assert names == ["hand_eye", "light_plane", "focal"]
    assert sensor_document(solution, before).blur == solution.camera.blur > 0.0
    unknown = replace(solution, camera=replace(solution.camera, blur=None))
    assert "blur" not in dump(sensor_document(unknown, belief))
    assert sensor_document(replace(unknown, camera_result=None), belief).blur == 0.99


def test_a_lens_softer_than_it_was_has_to_be_explained(finished):
    solution, belief = finished[0].solution, read_belief(ROOT / "calibration", "demo")
    softer = replace(solution, camera=replace(solution.camera, blur=1.1))
    gate = with_last_set(softer, belief, "fine").gates["last set"][-1]
    assert gate.name == "blur_percent" and gate.verdict == "warn"
    assert gate.value == pytest.approx(100.0 * (1.1 / 0.99 - 1.0))


def test_held_out_views_were_not_fitted(finished):
    answer = finished[0].solution.hand_eye
    assert len(answer.apart) == 3 and not set(answer.apart) & set(answer.used)
    assert answer.figures["holdout_rms_mm"] < 0.2


def test_the_same_pictures_give_the_same_set_again(plant, finished):
    done, _ = finished
    belief = read_belief(plant, "demo")
    again = solve_session(Session.read(done.session), belief)
    first, second = (one.hand_eye.held_out.result.carrier_from_camera
                     for one in (done.solution, again))
    assert first.distance(second) < (0.005, 1e-4)


def test_going_on_is_agreed_to(finished):
    _, operator = finished
    assert operator.heard("through the 14 views that are left") and operator.heard("way clear?")


def test_a_concluded_session_cannot_be_gone_on_with(plant, finished):
    with pytest.raises(DocumentError, match="no open session of `all`"):
        run_wizard(Request("all", "demo", PLAN, plant, speed=20.0, resume=True), Scripted())


@pytest.mark.parametrize("no_to", ["Is this the robot", "Is the way clear"])
def test_nothing_moves_without_consent(plant, finished, no_to):
    before = sorted((plant / "demo" / "sessions").iterdir())
    with pytest.raises(DocumentError, match="stopped by the operator"):
        run_wizard(Request("hand-eye", "demo", PLAN, plant, speed=20.0),
                   Scripted({no_to: False}))
    assert sorted((plant / "demo" / "sessions").iterdir()) == before


def test_warnings_need_a_reason(plant, finished, tmp_path):
    done, _ = finished
    folder = shutil.copytree(done.session, tmp_path / "session")
    header = json.loads((folder / "session.json").read_text())
    header["plan"]["reason"] = ""
    keep = [line for line in (folder / "views.jsonl").read_text().splitlines()
            if line.endswith("}")]
    (folder / "views.jsonl").write_text("\n".join(keep[:14]))
    (folder / "session.json").write_text(json.dumps(header))
    operator = Scripted()
    belief = read_belief(plant, "demo")
    result = conclude(Session.read(folder), belief, operator, Shown(belief, "all", "", None))
    assert result.set_id is None and not result.accepted
    assert operator.heard("Why is this set acceptable") or operator.heard("Refused")


@pytest.mark.parametrize(("begin", "place"), [
    (lambda plant, operator: run_wizard(Request("all", "demo", PLAN, plant), operator), "sessions"),
    (lambda plant, operator: check_cell(CheckRequest("demo", plant), operator), "drift")])
def test_what_could_not_be_kept_is_known_before_anything_is_asked(tmp_path, begin, place):
    plant = Path(shutil.copytree(ROOT / "calibration", tmp_path / "calibration"))
    (plant / "demo" / place).write_text("not a folder")
    operator = Scripted()
    with pytest.raises(DocumentError, match=f"{place}: expected a folder"):
        begin(plant, operator)
    assert operator.said == []
