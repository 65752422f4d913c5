"""How soft the lens draws an edge, from pictures of the board: against truth, and against rims."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_boards import (
    BOARD,
    BOARD_DESIGN,
    LENS,
    SETTING,
    TRUTH,
    lens_with,
    picture,
    random_pose,
    sharp_rim,
)
from ray_traced import detector

from cell.metrology.calibrate.board_blur import LensBlur, find_edges, solve_lens_blur
from cell.metrology.calibrate.board_pose import BoardView, locate_boards
from cell.metrology.calibrate.camera import CameraResult
from cell.metrology.calibrate.detect_board import detect_board
from cell.metrology.calibrate.gates import check_gates
from cell.metrology.calibrate.progress import camera_figures
from cell.metrology.detect.band import SMOOTHING
from cell.metrology.detect.hole import detect_hole
from cell.metrology.features import Expected
from cell.programs.calibration.recorded import read_gates

WORKING = LENS.working_distance
PIXEL, SAMPLING = 1.0 / 12.0, 1.0 / 6.0  # px²: of a pixel's square; of bilinear sampling
NOISY = {"read_noise": 4.0, "electrons_per_grey": 8.0}


def true_softness(blur_px):
    """What a blur in the lens becomes once it is seen by pixels and sampled between them."""
    return np.sqrt(blur_px**2 + PIXEL + SAMPLING)


def seen_in(image, design=BOARD_DESIGN):
    """The edges of a picture, and where its board stood."""
    view = detect_board(image, design).view
    return find_edges(image, view, design), locate_boards([view], TRUTH.camera)[0].camera_from_board


def seen_through(lenses, seed=5, **changes):
    """One view of the board through each lens: noise, tilts, rolls and distances drawn."""
    rng = np.random.default_rng(seed)
    return [seen_in(picture(random_pose(rng), rng, lens=lens, **changes)) for lens in lenses]


def solve(views, distance=WORKING):
    return solve_lens_blur(*zip(*views, strict=True), distance)


def ruled(blur, level="fine"):
    """What the gates make of a blur."""
    result = CameraResult(TRUTH.camera, np.zeros((9, 9)), (np.zeros((4, 2)),), (), np.ones((8, 8)),
                          0.0, blur)
    checks = check_gates(camera_figures(result), getattr(read_gates(), level).camera)
    return {check.name: check.verdict for check in checks if check.name.startswith("blur")}


@pytest.mark.parametrize("noise", [{}, NOISY], ids=["usual", "noisy"])
@pytest.mark.parametrize("blur_px", [0.6, 0.85, 1.2, 1.6, 2.0])
def test_a_known_blur_is_recovered(blur_px, noise):
    found = solve(seen_through([lens_with(blur_px=blur_px, **noise)] * 10))
    assert found.value == pytest.approx(true_softness(blur_px), rel=0.02)
    assert found.spread < 0.01 * found.value
    assert found.distance == WORKING and len(found.misses) == 10


@pytest.mark.parametrize("blur_px", [0.6, 0.85, 1.2, 2.0])
def test_the_rim_of_a_sharp_hole_is_as_soft(blur_px):
    lens, rng = lens_with(blur_px=blur_px), np.random.default_rng(8)
    board = solve(seen_through([lens] * 8)).value
    rims = [detect_hole(sharp_rim(lens, rng), TRUTH.camera, Expected(radius=5.0, thickness=1.0))
            for _ in range(4)]
    assert np.sqrt(np.array([rim.blur for rim in rims])**2 - SMOOTHING**2) == pytest.approx(
        board, rel=0.03)


@pytest.mark.parametrize(("blur", "disc"), [(0.8, 0.8), (1.3, 0.4), (1.3, 0.8)])
def test_so_it_is_where_the_blur_is_partly_a_disc(blur, disc):
    """An edge out of focus is no normal distribution: only what is measured alike agrees."""
    sharp = lens_with(blur_px=0.05, defocus_px_per_mm=0.0, read_noise=0.0, electrons_per_grey=1e9)
    rng = np.random.default_rng(4)

    def seen(image):
        light = detector.Lens(blur, disc, 0.0).blurred(image.astype(np.float32))
        return np.rint(light + rng.normal(0.0, 1.5, light.shape)).clip(0, 255).astype(np.uint8)

    board = solve([seen_in(seen(picture(random_pose(rng), rng, lens=sharp))) for _ in range(6)])
    rims = [detect_hole(seen(sharp_rim(sharp, rng)), TRUTH.camera,
                        Expected(radius=5.0, thickness=1.0)).blur for _ in range(3)]
    assert np.sqrt(np.array(rims)**2 - SMOOTHING**2) == pytest.approx(board.value, rel=0.03)


@pytest.mark.parametrize("marker_mm", [3.0, 4.0])
def test_markers_far_and_near_make_no_difference(marker_mm):
    board = BOARD.model_copy(update={"marker_mm": marker_mm})
    rng, lens = np.random.default_rng(5), lens_with(blur_px=1.6)
    views = [seen_in(picture(random_pose(rng), rng, lens=lens,
                             setting=replace(SETTING, boards=(board,))),
                     replace(BOARD_DESIGN, marker_mm=marker_mm)) for _ in range(6)]
    assert solve(views).value == pytest.approx(true_softness(1.6), rel=0.01)


@pytest.mark.parametrize("distance", [234.0, 242.4, 250.0])
def test_it_holds_for_the_distance_that_is_asked_for(distance):
    views = seen_through([LENS] * 16)
    design = TRUTH.design
    blur_px = np.hypot(design.blur_px, design.defocus_px_per_mm * (distance - WORKING))
    assert solve(views, distance).value == pytest.approx(true_softness(blur_px), rel=0.015)


def test_views_that_are_all_farther_off_speak_for_where_they_are():
    views = seen_through([LENS] * 8)
    far = [pose.translation[2] for _, pose in views]
    found = solve(views, 215.0)
    assert 215.0 < found.distance < np.median(far) + 10.0 and len(found.misses) == 3
    assert f"at {found.distance:.0f} mm" in str(found)


def shaken(rng):
    """A view in which the arm had not come to rest."""
    image = picture(random_pose(rng), rng)
    return seen_in(cv2.blur(image, (5, 5)))


@pytest.mark.parametrize("shook", [1, 3, 6])
def test_views_that_shook_do_not_count_and_are_told_of(shook):
    still = seen_through([LENS] * 9)
    rng = np.random.default_rng(9)
    found = solve([*still, *(shaken(rng) for _ in range(shook))])
    assert found.value == pytest.approx(solve(still).value, rel=0.01)
    assert ruled(solve(still)) == {"blur_px": "pass", "blur_spread_percent": "pass"}
    assert ruled(found) == {"blur_px": "pass", "blur_spread_percent": "warn"}


@pytest.mark.parametrize("level", ["fine", "coarse"])
def test_a_lens_that_was_touched_warns_and_is_not_refused(level):
    found = solve(seen_through([LENS] * 7 + [lens_with(blur_px=1.2)] * 7))
    assert ruled(found, level) == {"blur_px": "pass", "blur_spread_percent": "warn"}


def test_a_very_soft_lens_warns_and_is_not_refused():
    found = solve(seen_through([lens_with(blur_px=2.3)] * 8))
    assert found.value == pytest.approx(true_softness(2.3), rel=0.02)
    assert ruled(found) == {"blur_px": "warn", "blur_spread_percent": "pass"}


def test_of_overexposed_edges_nothing_is_said():
    assert solve(seen_through([LENS] * 4, exposure=0.02)) is None


def test_two_views_are_too_few():
    views = seen_through([LENS] * 3)
    assert solve(views) is not None and solve(views[:2]) is None
    assert solve_lens_blur([None] * 3, [pose for _, pose in views], WORKING) is None


def test_corners_without_neighbours_make_no_edge():
    image = picture(random_pose(np.random.default_rng(5)), np.random.default_rng(5))
    view = detect_board(image, BOARD_DESIGN).view
    place = np.rint(view.points_in_board / BOARD_DESIGN.square_mm).astype(int)
    apart = (place[:, :2] % 2 == 0).all(axis=1)
    edges = find_edges(image, BoardView(view.points_in_board[apart], view.pixels[apart]),
                       BOARD_DESIGN)
    assert len(edges.places) == len(edges.gaps) == 0


def test_the_words_say_what_it_means():
    blur = LensBlur(1.234, np.array([0.03, -0.04]), 242.0)
    assert blur.spread == pytest.approx(0.0354, abs=1e-4)
    assert "1.234 px" in str(blur) and "2 views 0.035 px" in str(blur) and "rounded" in str(blur)
    unknown = CameraResult(TRUTH.camera, np.zeros((9, 9)), (), (), np.ones((8, 8)), 0.0)
    assert "not known" in unknown.softness and "soft lens" in unknown.softness
