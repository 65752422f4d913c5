"""Single views that do not fit the others: left out, and named."""

from dataclasses import replace

import numpy as np
import pytest
from spoilt_sessions import FINE, disturbed, refused

from cell.core.geometry import Transform
from cell.metrology.calibrate.board_pose import BoardView
from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.motions import nudge


@pytest.mark.parametrize(("shift", "turn_deg"), [(1.0, 0.0), (0.0, 0.3), (100.0, 20.0)])
def test_one_bad_view_is_left_out_and_named(good, shift, turn_deg):
    def move(poses):
        step = np.array([np.radians(turn_deg), 0, 0, 0, shift, 0])
        poses[7] = poses[7] @ nudge(Transform.identity(), step).matrix

    answer = calibrate_hand_eye(disturbed(good, move), FINE)
    assert answer.left_out == (7,) and answer.verdict == "pass"
    assert answer.findings[0].code == "bad_view" and "view 7 " in answer.reasons[0]


def test_two_gross_views_do_not_hide_the_rest(good):
    def move(poses):
        poses[7] = poses[7] @ Transform.from_parts([0.3, 0, 0], [0, 0, 0]).matrix
        poses[2] = poses[2] @ Transform.from_parts([0, 0.1, 0], [0, 30.0, 0]).matrix

    answer = calibrate_hand_eye(disturbed(good, move), FINE)
    assert sorted(answer.left_out) == [2, 7] and answer.verdict == "pass"


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

    answer = calibrate_hand_eye(disturbed(good, stay), FINE)
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

    whole, spoilt = (calibrate_hand_eye(one, FINE) for one in (good, disturbed(good, move)))
    assert spoilt.left_out == (7,)
    assert spoilt.figures["split_half_percent"] == pytest.approx(
        whole.figures["split_half_percent"], rel=1e-4)
