"""A session that was read wrongly: units, conventions, order; and the cause that is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spoilt_sessions import disturbed, refused

from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.motions import inverse


def scaled(good, factor):
    poses = good.base_from_flange.copy()
    poses[:, :3, 3] *= factor
    return replace(good, base_from_flange=poses)


def turned(good, read):
    poses = good.base_from_flange.copy()
    poses[:, :3, :3] = read(Rotation.from_matrix(poses[:, :3, :3])).as_matrix()
    return replace(good, base_from_flange=poses)


@pytest.mark.parametrize(("factor", "said"), [(1e-3, "in m,"), (1 / 25.4, "in inch,")])
def test_units_of_the_robot(good, factor, said):
    assert said in refused(scaled(good, factor), "robot_unit").reasons[0]


def test_units_of_the_board(good):
    views = tuple(BoardView(view.points_in_board / 1000, view.pixels) for view in good.views)
    spoiled = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    refused(spoiled, "board_unit")
    both = scaled(spoiled, 1e-3)
    assert "are all lengths in mm?" in refused(both, "length_unit").reasons[0]


@pytest.mark.parametrize("axes", ["xyz", "ZYX"])
def test_rotation_vectors_read_as_euler_angles(good, axes):
    spoiled = turned(good, lambda given: Rotation.from_euler(axes, given.as_rotvec()))
    assert f"read as Euler angles {axes}" in refused(spoiled, "rotation_convention").reasons[0]


def test_euler_angles_read_as_rotation_vectors(good):
    spoiled = turned(good, lambda given: Rotation.from_rotvec(given.as_euler("xyz")))
    assert "Euler angles xyz that were" in refused(spoiled, "rotation_convention").reasons[0]


@pytest.mark.parametrize(("read", "said"), [
    (lambda r: Rotation.from_rotvec(r.as_euler("ZYX")), "angles ZYX that were read as rotation v"),
    (lambda r: Rotation.from_euler("xyz", r.as_euler("ZYX")), "that were read as Euler angles"),
    (lambda r: Rotation.from_euler("zyx", r.as_euler("ZYZ")), "Euler angles ZYZ that were read as"),
    (lambda r: Rotation.from_rotvec(np.radians(r.as_rotvec())), "in radians that were read as deg"),
    (lambda r: Rotation.from_rotvec(np.degrees(r.as_rotvec())), "in degrees that were read as rad"),
])
def test_other_conventions_of_rotation(good, read, said):
    assert said in refused(turned(good, read), "rotation_convention").reasons[0]


def test_quaternions_in_another_order(good):
    spoiled = turned(good, lambda given: Rotation.from_quat(given.as_quat()[:, [3, 0, 1, 2]]))
    assert "quaternions" in refused(spoiled, "rotation_convention").reasons[0]


def test_inverted_poses(good):
    spoiled = replace(good, base_from_flange=inverse(good.base_from_flange))
    assert "look inverted" in refused(spoiled, "poses_inverted").reasons[0]


@pytest.mark.parametrize("shift", [1, -1, 2])
def test_shifted_lists(good, shift):
    spoiled = replace(good, base_from_flange=np.roll(good.base_from_flange, shift, axis=0))
    answer = refused(spoiled, "lists_shifted")
    assert f"image i seems to go with pose i{shift:+d}" in answer.reasons[0]


@pytest.mark.parametrize("pair", [(4, 10), (0, 1)])
def test_swapped_views(good, pair):
    def swap(poses):
        poses[list(pair)] = poses[list(pair[::-1])]

    answer = refused(disturbed(good, swap), "views_swapped")
    assert f"views {pair[0]} and {pair[1]} look exchanged" in answer.reasons[0]
    assert answer.held_out is None, "nothing is solved from a misread session"


def test_exchanged_views_are_called_by_their_names(good):
    def swap(poses):
        poses[[4, 10]] = poses[[10, 4]]

    named = disturbed(good, swap).numbered(tuple(range(100, 120)))
    assert "views 104 and 110 look exchanged" in refused(named, "views_swapped").reasons[0]


def test_lists_that_do_not_belong_together(good):
    order = np.random.default_rng(4).permutation(len(good))
    refused(replace(good, base_from_flange=good.base_from_flange[order]), "unrelated")


def test_corners_that_are_numbered_otherwise(good):
    order = np.random.default_rng(2).permutation(88)
    views = tuple(BoardView(view.points_in_board, view.pixels[order[order < len(view.pixels)]])
                  for view in good.views)
    spoilt = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    assert "no flat board" in refused(spoilt, "corners").reasons[0]
