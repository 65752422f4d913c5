"""`cell locate` by its contract: what it prints, how it ends, and what it will not take."""

import json
import struct
import zlib

import cv2
import numpy as np
import pytest
from made_pairs import SENSOR, draw_scene

SENSOR_TEXT = """
image_size: [768, 576]
camera_matrix: {matrix}
distortion: {distortion}
light_plane: {plane}
"""


@pytest.fixture(scope="module")
def scene():
    return draw_scene(np.random.default_rng(51), radius=5.0, offset=1.0)


@pytest.fixture(scope="module")
def pair(scene):
    return scene.pair(np.random.default_rng(52))


@pytest.fixture
def words(workplace, scene, pair):
    """The options that name sensor and images, all in the working folder."""
    plane = SENSOR.light_plane
    (workplace.folder / "sensor.yaml").write_text(SENSOR_TEXT.format(
        matrix=SENSOR.camera.matrix.tolist(), distortion=SENSOR.camera.distortion.tolist(),
        plane=[*plane.normal.tolist(), plane.offset]))
    for name, image in zip(("hole.png", "stripe.png"), pair, strict=True):
        cv2.imwrite(str(workplace.folder / name), image)
    return ["--sensor", "sensor.yaml", "--hole", "hole.png", "--stripe", "stripe.png"]


def plan(scene, way=1.0):
    return ["--radius", "5.02", "--thickness", str(scene.sheet.thickness), "--normal",
            *(str(way * value) for value in scene.normal)]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_pair_is_located(cell, words, scene, way):
    code, out, _ = cell("locate", *words, *plan(scene, way), "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["ok"] is True
    error = np.array(answer["centre_mm"]) - scene.centre
    assert np.linalg.norm(error) < 0.02
    assert answer["radius_mm"] == pytest.approx(5.0, abs=0.03)
    assert np.array(answer["normal"]) @ scene.normal > 0.9999
    sigma = answer["uncertainty_mm"]
    assert (np.abs(error) < 3.0 * np.array([sigma[axis] for axis in "xyz"])).all()
    assert set(sigma) == {"x", "y", "z", "radius"}
    assert isinstance(answer["quality"], dict)


def test_a_wider_normal_is_a_wider_answer(cell, words, scene):
    def u_z(*more):
        return json.loads(cell("locate", *words, *plan(scene), *more, "--json")[1])[
            "uncertainty_mm"]["z"]

    assert u_z("--normal-sigma-deg", "2.0") > u_z()


def test_the_plain_method_has_no_normal(cell, words):
    code, out, _ = cell("locate", *words, "--method", "two-step", "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["normal"] is None
    assert answer["uncertainty_mm"]["z"] > 0.02  # it may be tilted, for all it knows


def test_for_people_there_is_a_table_and_a_picture(cell, words, workplace):
    code, out, _ = cell("locate", *words, "--picture", "seen.png")
    assert code == 0
    assert "normal_prior" in out
    assert cv2.imread(str(workplace.folder / "seen.png")).shape[0] > 300


def test_a_refusal_has_a_reason_and_a_picture(cell, words, workplace):
    blank = np.full((576, 768), 90, np.uint8)
    cv2.imwrite(str(workplace.folder / "hole.png"), blank)
    code, out, _ = cell("locate", *words, "--json", "--picture", "seen.png")
    answer = json.loads(out)
    assert code == 1
    assert (answer["ok"], answer["reason"]) == (False, "no_hole")
    assert answer["detail"]
    assert (workplace.folder / "seen.png").exists()


def spoil(workplace, how):
    path = workplace.folder / "hole.png"
    content = path.read_bytes()
    if how == "cut":
        path.write_bytes(content[:-300])
    elif how == "damaged":
        middle = len(content) // 2
        path.write_bytes(content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1:])
    elif how == "no image":
        path.write_bytes(b"hello")
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "small":
        cv2.imwrite(str(path), np.zeros((480, 640), np.uint8))
    elif how == "vast":  # says that it is, to fill the memory of who believes it
        header = b"IHDR" + struct.pack(">IIBBBBB", 60000, 60000, 8, 0, 0, 0, 0)
        path.write_bytes(content[:12] + header + struct.pack(">I", zlib.crc32(header))
                         + content[33:])
    else:
        path.unlink()


@pytest.mark.parametrize(("how", "said"), [
    ("cut", "cut short"), ("damaged", "damaged"), ("no image", "PNG"), ("empty", "empty"),
    ("small", "768 x 576"), ("gone", "no such file"), ("vast", "came 60000")])
def test_an_image_that_is_not_whole_is_bad_input(cell, words, workplace, how, said):
    spoil(workplace, how)
    code, out, err = cell("locate", *words, "--json")
    answer = json.loads(out)
    assert code == 2
    assert answer["ok"] is False
    assert answer["reason"]
    assert said in answer["detail"]
    assert "hole.png" in answer["detail"]
    assert "hole.png" in err


@pytest.mark.parametrize("more", [
    ("--radius", "-1"), ("--radius", "nan"), ("--radius", "1e6"), ("--radius", "1e-6"),
    ("--radius", "much"), ("--method", "other"), ("--normal-sigma-deg", "1e9"),
    ("--normal", "0", "0", "0"), ("--normal", "nan", "0", "1"), ("--normal", "0", "1", "0"),
    ("--normal-sigma-deg", "0"), ("--thickness", "inf"), ("--sensor", "none.yaml"),
    ("--sensor", "jobs/demo.yaml")])
def test_words_that_make_no_sense_are_bad_input(cell, words, more):
    code, out, _ = cell("locate", *words, *more, "--json")
    assert code == 2
    assert json.loads(out)["ok"] is False


def test_a_picture_that_cannot_be_written_is_bad_input(cell, words):
    code, _, err = cell("locate", *words, "--picture", "nowhere/seen.png")
    assert code == 2
    assert "nowhere" in err
