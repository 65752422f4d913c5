"""The drawn world differs from what the cell believes, as much as the belief says it may."""

import numpy as np
import pytest
from made_scenes import DEMO, demo_scene

from cell.core.documents.calibration import BodyDocument, HandEyeDocument, SensorDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.sim.scene import read_scene
from cell.sim.world import draw_world

SCENE = demo_scene()
WORLDS = [draw_world(SCENE.model_copy(update={"seed": seed})) for seed in range(300)]
SET = next((DEMO.parent / "sets").iterdir())


def believed(model, path):
    return parse(model, path.read_text(), str(path))


def ratio(drawn, covariance):
    """Standard deviation of what is drawn over what is stated, by component."""
    stated = np.sqrt(np.diag(covariance))
    seen = np.sqrt(np.mean(np.square(drawn), axis=0))
    return seen[stated > 0] / stated[stated > 0]


def test_the_stated_covariance_of_the_camera_is_that_of_the_worlds():
    sensor = believed(SensorDocument, SET / "sensor.yaml").model
    own = sensor.camera
    drawn = [[*np.diag(w.sensor.camera.matrix)[:2] - np.diag(own.matrix)[:2],
              *(w.sensor.camera.matrix - own.matrix)[:2, 2],
              *w.sensor.camera.distortion - own.distortion] for w in WORLDS]
    assert ratio(drawn, sensor.camera_covariance) == pytest.approx(1.0, abs=0.15)


def test_the_stated_covariance_of_the_light_plane_is_that_of_the_worlds():
    sensor = believed(SensorDocument, SET / "sensor.yaml").model
    drawn = [[*w.sensor.light_plane.normal - sensor.light_plane.normal,
              w.sensor.light_plane.offset - sensor.light_plane.offset] for w in WORLDS]
    assert ratio(drawn, sensor.light_plane_covariance) == pytest.approx(1.0, abs=0.15)
    correlation = np.corrcoef(np.transpose(drawn))[2, 3]
    stated = sensor.light_plane_covariance
    assert correlation == pytest.approx(
        stated[2, 3] / np.sqrt(stated[2, 2] * stated[3, 3]), abs=0.1)


def test_the_stated_covariance_of_the_hand_eye_is_that_of_the_worlds():
    own = believed(HandEyeDocument, SET / "hand_eye.yaml")
    mount = Transform(np.array(own.flange_from_camera))
    drawn = [_small(mount, w.flange_from_camera) for w in WORLDS]
    assert ratio(drawn, own.covariance) == pytest.approx(1.0, abs=0.15)


def test_the_stated_covariance_of_the_body_is_that_of_the_worlds():
    own = believed(BodyDocument, DEMO.parent / "body" / "demo.yaml")
    fixture = Transform(np.array(own.base_from_body))
    drawn = np.array([_small(fixture, w.base_from_fixture) for w in WORLDS])
    assert ratio(drawn, own.covariance) == pytest.approx(1.0, abs=0.15)
    pivot = np.array(SCENE.bodies.pivot)
    there = [w.base_from_fixture @ pivot - fixture @ pivot for w in WORLDS]
    assert np.std(there) == pytest.approx(SCENE.fixture_errors.mm, rel=0.15)


def test_without_errors_the_world_is_its_design():
    zero = {"sensor_errors": type(SCENE.sensor_errors)(), "hand_eye_errors":
            type(SCENE.hand_eye_errors)(), "fixture_errors": type(SCENE.fixture_errors)()}
    world = draw_world(SCENE.model_copy(update=zero))
    assert np.array_equal(world.sensor.camera.matrix, np.array(SCENE.sensor.camera_matrix))
    assert world.flange_from_camera.matrix == pytest.approx(np.array(SCENE.flange_from_camera))
    assert world.base_from_fixture.matrix == pytest.approx(np.array(SCENE.base_from_fixture))


@pytest.mark.parametrize(("old", "new", "said"), [
    ("panel: sill,", "panel: still,", "holes on no panel: SI1, SI2, SI3, SI4, SI5"),
    ("seed: 12", "sed: 12", "sed"),
    ("displacement_mm: 1.0", "displacement_mm: -1.0", "displacement_mm"),
    ("id: SI2", "id: SI1", "two holes have the same id"),
    ("seed: 12", "seed: -5", "seed: expected a number greater than or equal to 0"),
    ("model: ur10e", "model: ur99", "arm.model"),
    ("image_size: [768, 576]", "image_size: [0, 0]", "sensor.image_size"),
    ("normal: [0.05, -0.985, 0.16]", "normal: [0, 0, 0]", "expected a direction"),
])
def test_a_wrong_scene_is_refused_by_name(tmp_path, old, new, said):
    text = DEMO.read_text()
    assert old in text
    wrong = tmp_path / "scene.yaml"
    wrong.write_text(text.replace(old, new))
    with pytest.raises(DocumentError, match=said):
        read_scene(wrong)
    with pytest.raises(DocumentError, match="cannot be read"):
        read_scene(tmp_path / "none.yaml")


def _small(believed_pose, true_pose):
    """rx ry rz tx ty tz of the true frame against the believed one, along the outer axes."""
    turn = Transform.from_parts(true_pose.rotation @ believed_pose.rotation.T, np.zeros(3))
    return [*turn.rotation_vector, *true_pose.translation - believed_pose.translation]
