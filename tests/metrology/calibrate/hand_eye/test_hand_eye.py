import numpy as np
import pytest
from made_sessions import World, plan

from cell.core.geometry import Transform
from cell.metrology.calibrate.hand_eye.check import object_rms, solve_and_hold_out
from cell.metrology.calibrate.hand_eye.solve import RobotNoise, solve_hand_eye
from cell.metrology.calibrate.hand_eye.start import solve_park
from cell.metrology.motions import nudge

MOUNTS = ("flange", "static")


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("mount", MOUNTS)
def test_it_is_exact_without_noise(mount):
    world = World(mount=mount, noise_mm=0.0, noise_deg=0.0, noise_px=0.0)
    problem = world.session(np.random.default_rng(5), 8).problem()
    park = solve_park(problem.reference_from_carrier, problem.camera_from_board)
    result = solve_hand_eye(problem)
    for found in (park, result.carrier_from_camera):
        assert found.distance(world.carrier_from_camera) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert result.reference_from_board.distance(world.reference_from_board) == pytest.approx(
        (0.0, 0.0), abs=1e-6)
    assert object_rms(problem, result.carrier_from_camera) < 1e-6


@pytest.mark.parametrize("mount", MOUNTS)
def test_fifteen_random_poses(mount):
    world, found, predicted = World(mount=mount), [], []
    for seed in range(12):
        result = solve_hand_eye(world.session(np.random.default_rng(seed), 15).problem())
        found.append(world.point_error(result.carrier_from_camera))
        predicted.append(result.point_sigma(250.0))
    assert rms(found) <= 0.075
    assert 0.7 <= rms(predicted) / rms(found) <= 1.4


def test_poses_planned_from_a_rough_belief_are_worth_more_than_random_ones():
    world, planned, random = World(), [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        planned.append(solve_hand_eye(world.session(rng, poses=plan(world, rng, 8)).problem()))
        random.append(solve_hand_eye(world.session(rng, 8).problem()))
    predicted = [rms([one.point_sigma(250.0) for one in some]) for some in (planned, random)]
    assert predicted[0] < 0.8 * predicted[1]
    assert rms([world.point_error(one.carrier_from_camera) for one in planned]) < 0.09


def test_the_covariance_is_that_of_the_truth():
    """Half of the normalised errors of the whole pose lie below the median of chi-squared(6)."""
    world, distances = World(), []
    for seed in range(30):
        result = solve_hand_eye(world.session(np.random.default_rng(1000 + seed), 15).problem())
        found = result.carrier_from_camera
        turn = world.carrier_from_camera.rotation @ found.rotation.T
        error = np.concatenate([Transform.from_parts(turn, np.zeros(3)).rotation_vector,
                                world.carrier_from_camera.translation - found.translation])
        distances.append(error @ np.linalg.solve(result.covariance[:6, :6], error))
    assert np.median(distances) == pytest.approx(5.35, rel=0.45)


def test_a_view_that_contradicts_is_left_out_and_named():
    world = World()
    session = world.session(np.random.default_rng(2), 15)
    session.flanges[7] = nudge(session.flanges[7], np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]))
    result = solve_hand_eye(session.problem())
    assert result.dropped == (7,)
    assert world.point_error(result.carrier_from_camera) < 0.12


def test_weights_may_be_wrong_by_a_factor_of_five():
    world, right, wrong = World(), [], []
    for seed in range(12):
        problem = world.session(np.random.default_rng(seed), 15).problem()
        right.append(world.point_error(solve_hand_eye(problem).carrier_from_camera))
        other = type(problem)(problem.views, problem.mount, RobotNoise(0.25, 0.01))
        wrong.append(world.point_error(solve_hand_eye(other).carrier_from_camera))
    assert rms(wrong) < 1.4 * rms(right)


def test_the_hold_out_is_not_fitted():
    problem = World().session(np.random.default_rng(3), 20).problem()
    held = solve_and_hold_out(problem)
    assert len(held.apart) == 5 and len(held.result.misfits) == 15
    assert 0.05 < held.rms < 0.25
    spoiled = list(problem.views)
    bad = held.apart[2]
    spoiled[bad] = type(spoiled[bad])(nudge(spoiled[bad].base_from_flange, np.array(
        [0.0, 0.0, 0.0, 3.0, 0.0, 0.0])), spoiled[bad].board)
    other = solve_and_hold_out(type(problem)(tuple(spoiled), problem.mount, problem.noise))
    assert np.array_equal(other.result.carrier_from_camera.matrix,
                          held.result.carrier_from_camera.matrix)
    assert other.rms > 1.0


def test_fewer_than_seventeen_views_are_judged_in_five_folds():
    problem = World().session(np.random.default_rng(3), 16).problem()
    held = solve_and_hold_out(problem)
    assert held.apart == () and len(held.result.misfits) == 16
    assert object_rms(problem, held.result.carrier_from_camera) < held.rms < 0.3


def test_five_views_are_refused():
    with pytest.raises(ValueError, match="needs 6 views"):
        solve_hand_eye(World().session(np.random.default_rng(3), 5).problem())


def test_opencv_agrees_where_it_has_the_function():
    cv2 = pytest.importorskip("cv2")
    if not hasattr(cv2, "calibrateHandEye"):
        pytest.skip(f"OpenCV {cv2.__version__} has no calibrateHandEye")
    problem = World().session(np.random.default_rng(3), 15).problem()
    robot, boards = problem.reference_from_carrier, problem.camera_from_board
    turn, shift = cv2.calibrateHandEye(robot[:, :3, :3], robot[:, :3, 3], boards[:, :3, :3],
                                       boards[:, :3, 3], method=cv2.CALIB_HAND_EYE_PARK)
    theirs = Transform.from_parts(turn, shift.ravel())
    ours = solve_park(robot, boards)
    assert ours.distance(theirs) < (0.05, 1e-4)
