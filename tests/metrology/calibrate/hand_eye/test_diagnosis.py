"""What is wrong with all views at once: the board, the camera, the mounting; and its cause."""

import re

import numpy as np
import pytest
from made_sessions import BOARD, WIDE, World
from spoilt_sessions import FINE, refused

from cell.core.geometry import Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.motions import stack


def test_a_good_session_passes_without_a_word(good):
    answer = calibrate_hand_eye(good, FINE)
    assert answer.verdict == "pass"
    assert [finding.code for finding in answer.findings] == []
    assert answer.limited_by.startswith("The robot's repeatability")
    assert len(answer.apart) == 5 and len(answer.used) == 15


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


def test_a_camera_for_pictures_of_another_size(good):
    half = CameraModel((1224, 1024), WIDE.matrix * [[0.5], [0.5], [1.0]], WIDE.distortion)
    assert "beside a picture" in refused(good.with_camera(half), "intrinsics").reasons[0]
    views = tuple(BoardView(view.points_in_board, view.pixels / 2) for view in good.views)
    shrunk = HandEyeSession.seen(good.base_from_flange, views, good.camera, good.mount)
    assert "do not fit these pictures" in refused(shrunk, "intrinsics").reasons[0]


@pytest.mark.parametrize("shift", [0.5, 3.0])
def test_a_board_that_was_bumped(shift):
    world, rng = World(), np.random.default_rng(11)
    moved = World(reference_from_board=Transform.from_parts([0, 0, 0], [shift, 0, 0]) @ BOARD)
    before, after = world.session(rng, 10), moved.session(rng, 8)
    spoiled = HandEyeSession.seen(stack(before.flanges + after.flanges),
                                  tuple(before.views + after.views), WIDE, "flange")
    answer = refused(spoiled, "board_moved")
    assert "between view 9 and view 10" in answer.reasons[0]


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
