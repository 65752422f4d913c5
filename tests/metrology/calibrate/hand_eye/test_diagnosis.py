"""Each fault of a session, made on purpose, and the cause that is named for it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from made_sessions import BOARD, WIDE, World
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.motions import inverse, nudge, stack
from cell.programs.calibration.recorded import read_gates

FINE = read_gates().fine


def session(seed=0, count=20, **world):
    return World(**world).session(np.random.default_rng(seed), count).as_recorded()


@pytest.fixture(scope="module", params=["flange", "static"])
def good(request):
    return session(mount=request.param)


def refused(spoiled, code):
    answer = calibrate_hand_eye(spoiled, FINE)
    assert answer.verdict == "refuse"
    assert answer.findings[0].code == code, answer.reasons
    assert answer.reasons[0] == answer.findings[0].sentence
    return answer


def robot(good, change):
    poses = good.base_from_flange.copy()
    change(poses)
    return replace(good, base_from_flange=poses)


def scaled(good, factor):
    poses = good.base_from_flange.copy()
    poses[:, :3, 3] *= factor
    return replace(good, base_from_flange=poses)


def turned(good, read):
    poses = good.base_from_flange.copy()
    poses[:, :3, :3] = read(Rotation.from_matrix(poses[:, :3, :3])).as_matrix()
    return replace(good, base_from_flange=poses)


def test_a_good_session_passes_without_a_word(good):
    answer = calibrate_hand_eye(good, FINE)
    assert answer.verdict == "pass"
    assert [finding.code for finding in answer.findings] == []
    assert answer.limited_by.startswith("The robot's repeatability")
    assert len(answer.apart) == 5 and len(answer.used) == 15


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

    answer = refused(robot(good, swap), "views_swapped")
    assert f"views {pair[0]} and {pair[1]} look exchanged" in answer.reasons[0]
    assert answer.held_out is None, "nothing is solved from a misread session"


def test_exchanged_views_are_called_by_their_names(good):
    def swap(poses):
        poses[[4, 10]] = poses[[10, 4]]

    named = robot(good, swap).numbered(tuple(range(100, 120)))
    assert "views 104 and 110 look exchanged" in refused(named, "views_swapped").reasons[0]


def test_lists_that_do_not_belong_together(good):
    order = np.random.default_rng(4).permutation(len(good))
    refused(replace(good, base_from_flange=good.base_from_flange[order]), "unrelated")


@pytest.mark.parametrize(("shift", "turn_deg"), [(1.0, 0.0), (0.0, 0.3), (100.0, 20.0)])
def test_one_bad_view_is_left_out_and_named(good, shift, turn_deg):
    def move(poses):
        step = np.array([np.radians(turn_deg), 0, 0, 0, shift, 0])
        poses[7] = poses[7] @ nudge(Transform.identity(), step).matrix

    answer = calibrate_hand_eye(robot(good, move), FINE)
    assert answer.left_out == (7,) and answer.verdict == "pass"
    assert answer.findings[0].code == "bad_view" and "view 7 " in answer.reasons[0]


def test_two_gross_views_do_not_hide_the_rest(good):
    def move(poses):
        poses[7] = poses[7] @ Transform.from_parts([0.3, 0, 0], [0, 0, 0]).matrix
        poses[2] = poses[2] @ Transform.from_parts([0, 0.1, 0], [0, 30.0, 0]).matrix

    answer = calibrate_hand_eye(robot(good, move), FINE)
    assert sorted(answer.left_out) == [2, 7] and answer.verdict == "pass"


@pytest.mark.parametrize("factor", [1.01, 0.97])
def test_a_board_of_another_size(good, factor):
    views = tuple(BoardView(view.points_in_board / factor, view.pixels) for view in good.views)
    spoiled = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    sentence = refused(spoiled, "board_scale").reasons[0]
    percent = float(re.search(r"the board is ([0-9.]+) % (larger|smaller)", sentence)[1])
    assert percent == pytest.approx(100 * abs(factor - 1), rel=0.15)
    assert ("larger" if factor > 1 else "smaller") in sentence


def test_two_tenths_of_a_percent_do_not_show(good):
    """That is why the board's certificate is asked for."""
    views = tuple(BoardView(view.points_in_board / 1.002, view.pixels) for view in good.views)
    spoiled = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    assert calibrate_hand_eye(spoiled, FINE).verdict == "pass"


@pytest.mark.parametrize(("focal", "centre"), [(1.01, 0.0), (1.0, 20.0)])
def test_wrong_intrinsics(good, focal, centre):
    matrix = WIDE.matrix * [[focal, 1, 1], [1, focal, 1], [1, 1, 1]] + [[0, 0, centre], [0] * 3,
                                                                        [0] * 3]
    refused(good.with_camera(CameraModel(WIDE.image_size, matrix, WIDE.distortion)), "intrinsics")


def test_a_lens_without_its_distortion(good):
    refused(good.with_camera(CameraModel(WIDE.image_size, WIDE.matrix, np.zeros(5))), "intrinsics")


@pytest.mark.parametrize("shift", [0.5, 3.0])
def test_a_board_that_was_bumped(shift):
    world, rng = World(), np.random.default_rng(11)
    moved = World(reference_from_board=Transform.from_parts([0, 0, 0], [shift, 0, 0]) @ BOARD)
    before, after = world.session(rng, 10), moved.session(rng, 8)
    spoiled = HandEyeSession.seen(stack(before.flanges + after.flanges),
                                  tuple(before.views + after.views), WIDE, "flange")
    answer = refused(spoiled, "board_moved")
    assert "between view 9 and view 10" in answer.reasons[0]


def test_the_robot_moved_during_an_exposure(good):
    after = good.base_from_flange.copy()
    after[5, 0, 3] += 0.03
    after[9] = after[9] @ Transform.from_parts([0, 0, np.radians(0.01)], [0, 0, 0]).matrix
    answer = calibrate_hand_eye(replace(good, after=after), FINE)
    assert answer.left_out == (5, 9)
    assert [finding.code for finding in answer.findings] == ["robot_moved", "robot_moved"]


def again(good, rows):
    """The session with some of its views in place of others: pose and picture."""
    return HandEyeSession.seen(good.base_from_flange[rows], tuple(good.views[row] for row in rows),
                               good.camera, good.mount)


def test_a_view_that_is_there_twice_counts_once(good):
    answer = calibrate_hand_eye(again(good, [*range(20), 3, 8]), FINE)
    assert answer.left_out == (20, 21) and answer.verdict == "pass"
    assert answer.reasons[0].startswith("view 20 is view 3 once more")
    refused(again(good, [*range(10), *range(10)]), "preview")
    refused(again(good, [0, 1, 2, 3, 4] * 4), "too_few_views")


def test_an_old_pose_and_an_old_picture(good):
    def stay(poses):
        poses[7] = poses[6]

    answer = calibrate_hand_eye(robot(good, stay), FINE)
    assert answer.left_out == (7,) and answer.verdict == "pass"
    assert answer.reasons[0].startswith("views 6 and 7 have the same robot pose but not")
    views = tuple(good.views[6 if row == 7 else row] for row in range(20))
    answer = calibrate_hand_eye(HandEyeSession.seen(good.base_from_flange, views, good.camera,
                                                    good.mount), FINE)
    assert answer.reasons[0].startswith("views 6 and 7 have the same picture but not")


def test_a_blurred_picture_is_left_out(good):
    noise = np.random.default_rng(1).normal(0.0, 0.5, good.views[4].pixels.shape)
    views = list(good.views)
    views[4] = BoardView(views[4].points_in_board, views[4].pixels + noise)
    answer = calibrate_hand_eye(HandEyeSession.seen(good.base_from_flange, tuple(views),
                                                    good.camera, good.mount), FINE)
    assert answer.left_out == (4,) and answer.findings[0].code == "poor_picture"


def test_a_bad_view_does_not_change_what_is_said_of_the_camera(good):
    def move(poses):
        poses[7, :3, 3] += 40.0

    whole, spoilt = (calibrate_hand_eye(one, FINE) for one in (good, robot(good, move)))
    assert spoilt.left_out == (7,)
    assert spoilt.figures["split_half_percent"] == pytest.approx(
        whole.figures["split_half_percent"], rel=1e-4)


def test_a_camera_for_pictures_of_another_size(good):
    half = CameraModel((1224, 1024), WIDE.matrix * [[0.5], [0.5], [1.0]], WIDE.distortion)
    assert "beside a picture" in refused(good.with_camera(half), "intrinsics").reasons[0]
    views = tuple(BoardView(view.points_in_board, view.pixels / 2) for view in good.views)
    shrunk = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    assert "do not fit these pictures" in refused(shrunk, "intrinsics").reasons[0]


def test_corners_that_are_numbered_otherwise(good):
    order = np.random.default_rng(2).permutation(88)
    views = tuple(BoardView(view.points_in_board, view.pixels[order[order < len(view.pixels)]])
                  for view in good.views)
    spoilt = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    assert "no flat board" in refused(spoilt, "corners").reasons[0]


def poses_alone(good):
    return HandEyeSession.of_poses(good.base_from_flange,
                                   stack(board.camera_from_board for board in good.boards),
                                   good.mount)


def test_poses_alone_are_looked_through_as_well(good):
    alone = poses_alone(good)
    answer = calibrate_hand_eye(alone, FINE)
    assert (answer.verdict, answer.reasons) == ("solved", ())
    boards = stack(board.camera_from_board for board in alone.boards)
    boards[:, :3, 3] /= 1.02
    larger = HandEyeSession.of_poses(alone.base_from_flange, boards, alone.mount)
    answer = calibrate_hand_eye(larger, FINE)
    assert (answer.verdict, answer.findings[0].code) == ("solved", "board_scale")
    assert re.match(r"the board is (1.[89]|2.[0-3]) % larger", answer.reasons[0])
    few = calibrate_hand_eye(alone.without(range(9, 20)), FINE)
    assert (few.verdict, few.findings[0].code) == ("solved", "preview")


def test_views_that_only_shift_say_so():
    still = session(cone_deg=0.01, roll_deg=0.01)
    answer = refused(still, "degenerate_rotations")
    assert "hardly turn at all" in answer.reasons[0] and answer.left_out == ()


def test_parallel_axes_name_the_missing_motion():
    flat = session(cone_deg=0.5, roll_deg=90.0)
    sentence = refused(flat, "degenerate_rotations").reasons[0]
    assert "tilt about the camera's" in sentence
    stiff = session(cone_deg=4.0, roll_deg=5.0)
    answer = calibrate_hand_eye(stiff, FINE)
    assert answer.verdict == "refuse"
    assert any("roll" in reason for reason in answer.reasons)


def test_few_views(good):
    assert "5 views" in refused(good.without(range(5, 20)), "too_few_views").reasons[0]
    for count in (6, 7, 11):
        answer = refused(good.without(range(count, 20)), "preview")
        assert answer.held_out is not None, "a preview is shown"
        assert "cannot be activated" in answer.reasons[0]
