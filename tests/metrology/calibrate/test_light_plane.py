"""Light plane and camera from pictures of the virtual cell, whose truth differs from the design."""

import numpy as np
import pytest
from made_boards import BOARD_DESIGN, TRUTH, picture, random_pose

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Plane, Transform
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.camera import solve_camera
from cell.metrology.calibrate.detect_board import detect_board
from cell.metrology.calibrate.detect_board_stripe import detect_board_stripe
from cell.metrology.calibrate.light_plane import StripeOnBoard, solve_light_plane
from cell.metrology.detect.ridge import runs_upright


@pytest.fixture(scope="module")
def views():
    """Ten poses of the board: where it truly was, its corners, and the stripe on it."""
    rng = np.random.default_rng(3)
    taken = []
    for _ in range(10):
        pose = random_pose(rng)
        ring, stripe = picture(pose, rng), picture(pose, rng, laser=True)
        pixels = detect_board_stripe(stripe, ring, TRUTH.camera,
                                     upright=runs_upright(TRUTH.light_plane))
        taken.append((pose, detect_board(ring, BOARD_DESIGN), pixels))
    return taken


def test_corners_are_found_without_bias(views):
    misses = np.concatenate([TRUTH.camera.project(pose @ seen.view.points_in_board)
                             - seen.view.pixels for pose, seen, _ in views])
    assert np.abs(misses.mean(axis=0)).max() < 0.02
    assert np.sqrt(np.mean(misses ** 2)) < 0.1
    assert all(seen.exposure == "ok" and seen.sharpness > 0.2 for _, seen, _ in views)


def test_the_stripe_is_not_pulled_by_the_print(views):
    for pose, _, pixels in views:
        points = StripeOnBoard(pixels, pose).meet(TRUTH.camera)
        assert abs(float(TRUTH.light_plane.distance(points).mean())) < 0.008


def test_the_plane_and_what_it_is_said_to_be_worth(views):
    boards = locate_boards([seen.view for _, seen, _ in views], TRUTH.camera)
    result = solve_light_plane([StripeOnBoard(pixels, board.camera_from_board) for board,
                                (_, _, pixels) in zip(boards, views, strict=True)], TRUTH.camera)
    assert result.rms < 0.03 and result.left_out_rms < 0.03
    for pixel in ([384.0, 288.0], [384.0, 60.0], [384.0, 500.0]):
        point = TRUTH.light_plane.meet(TRUTH.camera.rays(np.array(pixel)))
        miss = abs(float(result.plane.distance(point)))
        row = np.append(point, 1.0)
        assert miss < max(0.02, 5.0 * np.sqrt(row @ result.covariance @ row))


def test_camera_and_plane_found_together_agree_although_the_focal_length_is_a_little_off(views):
    own = solve_camera([seen.view for _, seen, _ in views], TRUTH.camera.image_size)
    assert own.rms_px < 0.15
    assert own.camera.matrix[0, 0] / TRUTH.camera.matrix[0, 0] == pytest.approx(1.0, abs=0.0015)
    sigma = np.sqrt(np.diag(own.covariance))
    assert abs(own.camera.matrix[0, 0] - TRUTH.camera.matrix[0, 0]) < 4.0 * sigma[0]
    assert own.covered > 0.6


def made_stripes(count, tilt, depth, rng):
    plane = Plane.from_coefficients([0.87, 0.0, 0.49, -118.0])
    for _ in range(count):
        turn = np.array([*(rng.uniform(-tilt, tilt, 2)), 0.0])
        board = Transform.from_parts(turn, [0.0, 0.0, 242.0 + rng.uniform(-depth, depth)])
        along = np.cross(plane.normal, board.rotation[:, 2])
        start = np.linalg.solve(np.array([plane.normal, board.rotation[:, 2], along]),
                                [-plane.offset, board.rotation[:, 2] @ board.translation, 0.0])
        points = start + np.linspace(-15, 15, 60)[:, None] * along / np.linalg.norm(along)
        yield StripeOnBoard(TRUTH.camera.project(points), board), plane


def test_it_is_exact_without_noise():
    stripes, planes = zip(*made_stripes(6, 0.3, 20.0, np.random.default_rng(1)), strict=True)
    result = solve_light_plane(stripes, TRUTH.camera)
    assert abs(result.plane.normal @ planes[0].normal) == pytest.approx(1.0, abs=1e-12)
    assert result.rms < 1e-7


def test_a_spoilt_pose_is_outvoted():
    stripes, planes = zip(*made_stripes(9, 0.3, 20.0, np.random.default_rng(1)), strict=True)
    bad = StripeOnBoard(stripes[4].pixels + np.array([2.0, 0.0]), stripes[4].camera_from_board)
    result = solve_light_plane([*stripes[:4], bad, *stripes[5:]], TRUTH.camera)
    assert abs(result.plane.normal @ planes[0].normal) == pytest.approx(1.0, abs=1e-9)
    assert int(np.argmax(result.left_out)) == 4


def test_poses_that_span_no_plane_are_refused():
    rng = np.random.default_rng(1)
    same = [stripe for stripe, _ in made_stripes(1, 0.0, 0.0, rng)] * 5
    with pytest.raises(UnmeasurableError, match="one_line"):
        solve_light_plane(same, TRUTH.camera)
    with pytest.raises(UnmeasurableError, match="too_few_poses"):
        solve_light_plane(same[:3], TRUTH.camera)


def test_no_board_says_what_to_do():
    with pytest.raises(UnmeasurableError, match="too dark"):
        detect_board(np.zeros((576, 768), np.uint8), BOARD_DESIGN)
