"""`cell calibrate hand-eye --from`: the recorded sessions of real robots, and spoilt folders."""

import io
import json
import shutil

import numpy as np
import pytest
import yaml
from made_sessions import recorded_sessions


@pytest.fixture
def sessions():
    return recorded_sessions()


@pytest.fixture
def solve(cell):
    def call(folder, *words):
        code, out, _ = cell("calibrate", "hand-eye", "--from", folder, "--json", *words)
        return code, json.loads(out)

    return call


@pytest.fixture
def copy(sessions, tmp_path):
    """A session that passes, free to be spoilt."""
    return shutil.copytree(sessions / "ic_charuco_own_intr", tmp_path / "session")


def expected(folder):
    return yaml.safe_load((folder / "expected.yaml").read_text())


def test_a_real_session_passes_the_coarse_gates(solve, sessions):
    folder = sessions / "ic_charuco_own_intr"
    code, answer = solve(folder, "--gates", "coarse")
    wanted = expected(folder)
    ml = wanted["obtained"]["ml"]
    assert (code, answer["verdict"], answer["reasons"]) == (0, "pass", [])
    assert answer["object_rms_mm"] <= 1.05 * ml["object_rms_mm"]
    assert answer["holdout_rms_mm"] <= 1.15
    found, theirs = (np.array(pose) for pose in (answer["base_from_camera"],
                                                 ml["base_from_camera"]))
    point = [0.0, 0.0, wanted["obtained"]["distance_mm"], 1.0]
    assert np.linalg.norm(((found - theirs) @ point)[:3]) < 2.0
    assert np.linalg.eigvalsh(np.array(answer["covariance"])).min() > 0
    assert "flange_from_camera" not in answer


def test_it_does_not_pass_as_a_fine_cell(solve, sessions):
    code, answer = solve(sessions / "ic_charuco_own_intr")
    assert (code, answer["verdict"]) == (1, "refuse")


@pytest.mark.parametrize("gates", ["fine", "coarse"])
@pytest.mark.parametrize("name", ["ic_charuco_given_intr", "ur5e_d415"])
def test_doubtful_intrinsics_are_refused_and_named_first(solve, sessions, name, gates):
    code, answer = solve(sessions / name, "--gates", gates)
    assert (code, answer["verdict"]) == (1, "refuse")
    assert "intrinsics" in answer["reasons"][0]
    assert answer["limited_by"].startswith("The intrinsics")


def test_poses_alone_are_solved(solve, sessions):
    folder = sessions / "moveit_solver"
    code, answer = solve(folder)
    wanted = expected(folder)
    found = np.array(answer["base_from_camera"])
    assert (code, answer["verdict"], answer["gates"]) == (0, "solved", [])
    length = np.linalg.norm(wanted["expected_translation_mm"])
    assert np.linalg.norm(found[:3, 3] - wanted["expected_translation_mm"]) < 0.01 * length


@pytest.mark.parametrize("name", ["ic_charuco_own_intr", "moveit_solver", "ur5e_d415"])
def test_the_mount_is_found_in_the_data_where_nobody_says_it(solve, sessions, tmp_path, name):
    folder = shutil.copytree(sessions / name, tmp_path / name)
    mount = expected(folder)["camera_mount"]
    (folder / "expected.yaml").unlink()
    _, answer = solve(folder, "--gates", "coarse")
    assert ("flange_from_camera" if mount == "flange" else "base_from_camera") in answer
    assert f"taken as {mount}" in answer["notes"][0]
    _, told = solve(folder, "--gates", "coarse", "--mount", mount)
    assert told["notes"] == []


@pytest.mark.parametrize("name", ["ic_charuco_own_intr", "moveit_solver", "ur5e_d415"])
def test_inverted_poses_are_told_from_the_other_mount(solve, sessions, tmp_path, name):
    folder = shutil.copytree(sessions / name, tmp_path / name)
    (folder / "expected.yaml").unlink()
    rows = (folder / "base_from_flange.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows[1:]])
    table[:, 1:] = np.linalg.inv(table[:, 1:].reshape(-1, 4, 4)).reshape(-1, 16)
    np.savetxt(folder / "base_from_flange.csv", table, delimiter=",", header=rows[0], comments="")
    code, answer = solve(folder, "--gates", "coarse")
    assert (code, answer["verdict"]) == (1, "refuse")
    assert "poses look inverted" in answer["reasons"][0]


def test_a_session_in_metres_is_named_and_not_corrected(solve, copy):
    rows = (copy / "base_from_flange.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows[1:]])
    table[:, [4, 8, 12]] /= 1000
    np.savetxt(copy / "base_from_flange.csv", table, delimiter=",", header=rows[0], comments="")
    code, answer = solve(copy, "--gates", "coarse")
    assert (code, answer["verdict"], answer["base_from_camera"]) == (1, "refuse", None)
    assert "in m," in answer["reasons"][0]


NO_CAMERA = """
image_size: [1600, 1200]
camera_matrix: [[0, 0, 800], [0, 0, 600], [0, 0, 1]]
distortion: [0, 0, 0, 0, 0]
"""


def an_array():
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


def spoil_rows(folder):
    file = folder / "base_from_flange.csv"
    file.write_text("\n".join(file.read_text().splitlines()[:-1]))


def spoil_rotation(folder):
    file = folder / "base_from_flange.csv"
    lines = file.read_text().splitlines()
    cells = lines[3].split(",")
    cells[1] = "0.5"
    file.write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:]]))


def spoil_number(folder):
    file = folder / "base_from_flange.csv"
    file.write_text(file.read_text().replace("\n1,", "\n1,nan", 1))


@pytest.mark.parametrize(("spoil", "said"), [
    (lambda folder: (folder / "views.npz").unlink(), "views.npz: there is no such file"),
    (lambda folder: (folder / "camera.yaml").unlink(), "camera.yaml: there is no such file"),
    (lambda folder: (folder / "base_from_flange.csv").unlink(), "there is no such file"),
    (lambda folder: (folder / "views.npz").write_bytes(b"PK\3\4 torn"), "not a readable .npz"),
    (lambda folder: np.savez(folder / "views.npz", object_mm=np.zeros((14, 3, 3))), "image_px"),
    (lambda folder: np.savez(folder / "views.npz", object_mm=np.zeros((14, 4, 3)),
                             image_px=np.zeros((14, 3, 2))), "expected object_mm (view,"),
    (lambda folder: (folder / "camera.yaml").write_text("image_size: [1, 2]"), "camera_matrix"),
    (lambda folder: (folder / "expected.yaml").write_text("camera_mount: roof"), "roof"),
    (lambda folder: (folder / "views.npz").write_bytes(an_array()), "not a readable .npz"),
    (lambda folder: np.savez(folder / "views.npz", object_mm=np.zeros((14, 3, 3), complex),
                             image_px=np.zeros((14, 3, 2))), "expected real numbers"),
    (lambda folder: np.savez(folder / "views.npz", object_mm=np.zeros((14, 8, 3)),
                             image_px=np.zeros((14, 8, 2))), "not on one line"),
    (lambda folder: (folder / "camera.yaml").write_text(NO_CAMERA), "fx, fy > 0"),
    (spoil_rows, "13 robot poses but 14 views"),
    (spoil_rotation, "line 4"),
    (spoil_number, "line 3"),
])
def test_what_cannot_be_read_ends_with_2(solve, copy, spoil, said):
    spoil(copy)
    code, answer = solve(copy)
    assert (code, answer["ok"], answer["reason"]) == (2, False, "bad_input")
    assert said in answer["detail"]


def test_views_without_a_board_are_left_out_and_said(solve, copy):
    with np.load(copy / "views.npz") as archive:
        points, pixels = archive["object_mm"], archive["image_px"].copy()
    pixels[3] = np.nan
    pixels[5, 5:] = np.nan
    np.savez(copy / "views.npz", object_mm=points, image_px=pixels)
    _, answer = solve(copy, "--gates", "coarse")
    assert [note[:9] for note in answer["notes"]] == ["view 3 ha", "view 5 ha"]
    assert 3 not in answer["views"]["used"]


def test_no_such_folder(solve, tmp_path):
    assert solve(tmp_path / "none")[0] == 2


def test_people_get_a_table(cell, sessions):
    code, out, _ = cell("calibrate", "hand-eye", "--from", sessions / "ur5e_d415",
                        "--gates", "coarse")
    assert code == 1
    assert "the intrinsics are doubtful" in out.replace("\n", " ")
    assert out.rstrip().endswith("refuse")
