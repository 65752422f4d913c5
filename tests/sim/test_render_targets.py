"""Boards and spheres are where they are seen, and the stripe falls on them as on sheets."""

import cv2
import numpy as np
import pytest
from made_scenes import demo_scene, demo_world
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps

WORLD, SCENE = demo_world(), demo_scene()
BOARD, SPHERE = SCENE.boards[0], SCENE.spheres[0]
LENS = Lens(WORLD.sensor)
SETTING = Setting(WORLD.base_from_fixture, None, (BOARD,), (SPHERE,))


def over(point, *, distance=242.0, turn_deg=(0.0, 0.0, 0.0), frame=None):
    """base_from_camera that looks at a point along the z axis of a frame, leaned and rolled."""
    lean = Rotation.from_euler("zxy", turn_deg, degrees=True).as_matrix()
    turn = (np.diag([1.0, -1.0, -1.0]) if frame is None else frame.rotation) @ lean
    return Transform.from_parts(turn, point - distance * turn[:, 2])


def picture(pose, *, ring=True, laser=False, exposure=0.008, noise=1):
    chance = None if noise is None else np.random.default_rng(noise)
    return render(LENS, SETTING, pose, Lamps(WORLD.sensor, ring, laser, 5), exposure, chance)


@pytest.mark.parametrize("turn", [(0, 0, 0), (35, 14, -3), (-70, -12, 18), (110, 5, 22)])
def test_corners_of_the_board_are_found_where_they_are(turn):
    base_from_board = Transform(np.array(BOARD.base_from_board))
    middle = base_from_board @ np.array([*np.array(BOARD.squares) * BOARD.square_mm / 2, 0.0])
    pose = over(middle, turn_deg=turn, frame=base_from_board)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, BOARD.dictionary))
    printed = cv2.aruco.CharucoBoard(BOARD.squares, BOARD.square_mm, BOARD.marker_mm, dictionary)
    corners, numbers, _, _ = cv2.aruco.CharucoDetector(printed).detectBoard(picture(pose))
    assert len(numbers) >= 35
    where = np.array(printed.getChessboardCorners(), float)[numbers.ravel()]
    expected = WORLD.sensor.camera.project(pose.inverse @ base_from_board @ where)
    off = corners.reshape(-1, 2) - expected
    assert np.abs(off.mean(axis=0)).max() < 0.02
    assert off.std() < 0.08


def test_a_board_seen_from_behind_or_out_of_sight_is_not_there():
    base_from_board = Transform(np.array(BOARD.base_from_board))
    behind = over(base_from_board.translation, frame=base_from_board @ Transform.from_parts(
        [np.pi, 0.0, 0.0], np.zeros(3)))
    away = over(np.array([5000.0, 0.0, 0.0]))
    for pose in (behind, away):
        assert picture(pose).max() < 20


def test_the_stripe_on_the_board_lies_in_the_light_plane_and_on_the_board():
    base_from_board = Transform(np.array(BOARD.base_from_board))
    middle = base_from_board @ np.array([30.0, 22.5, 0.0])
    pose = over(middle, distance=250.0, turn_deg=(20, 15, 10), frame=base_from_board)
    image = picture(pose, ring=False, laser=True, exposure=0.006, noise=None).astype(float)
    image[image < 12] = 0.0
    rows = np.flatnonzero(image.sum(axis=1) > 60)
    columns = (image @ np.arange(768.0))[rows] / image.sum(axis=1)[rows]
    board_from_camera = base_from_board.inverse @ pose
    rays = WORLD.sensor.camera.rays(np.column_stack([columns, rows]))
    points = WORLD.sensor.light_plane.meet(rays)
    height = (board_from_camera @ points)[:, 2]
    assert len(rows) > 300
    assert abs(np.median(height)) < 0.02  # mm: the print pulls the stripe at its edges


def test_the_sphere_is_where_it_is_and_as_large():
    centre = np.array(SPHERE.centre)
    pose = over(centre + np.array([3.0, -2.0, 0.0]), distance=250.0, turn_deg=(40, 3, -4))
    image = picture(pose, noise=None).astype(float)
    level = cv2.GaussianBlur(image, (0, 0), 1.0)
    contour = max(cv2.findContours((level > 24).astype(np.uint8), cv2.RETR_EXTERNAL,
                                   cv2.CHAIN_APPROX_NONE)[0], key=len).reshape(-1, 2)
    rays = WORLD.sensor.camera.rays(contour.astype(float))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)

    def misses(guess):
        return np.linalg.norm(np.cross(rays, guess), axis=1) - SPHERE.radius

    found = least_squares(misses, [0.0, 0.0, 240.0]).x
    expected = pose.inverse @ centre
    assert found[:2] == pytest.approx(expected[:2], abs=0.05)
    assert found[2] == pytest.approx(expected[2], abs=5.0)  # the limb is dark: it looks smaller


def test_the_stripe_on_the_sphere_lies_on_the_sphere():
    centre = np.array(SPHERE.centre)
    pose = over(centre, distance=252.0, turn_deg=(10, 2, 1))
    image = picture(pose, ring=False, laser=True, exposure=0.004, noise=None).astype(float)
    image[image < 14] = 0.0
    rows = np.flatnonzero(image.sum(axis=1) > 200)
    columns = (image @ np.arange(768.0))[rows] / image.sum(axis=1)[rows]
    points = WORLD.sensor.light_plane.meet(
        WORLD.sensor.camera.rays(np.column_stack([columns, rows])))
    off = np.linalg.norm(points - pose.inverse @ centre, axis=1) - SPHERE.radius
    assert len(rows) > 150
    assert abs(np.median(off)) < 0.03
