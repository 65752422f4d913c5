"""The arm's kinematics: properties, an independent oracle, calibration residuals, singularities."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime, brentq

from cell.core.geometry import Transform
from cell.core.kinematics import PUBLISHED_MM, arm_for

models = st.sampled_from(sorted(PUBLISHED_MM))
angle = st.floats(-3.1, 3.1)
joint_vectors = st.tuples(angle, angle, angle, angle, angle, angle).map(np.array)
RESIDUALS = {"a": (0.1, -0.4, 0.3, 0.05, -0.02, 0.0), "d": (0.2, 0.0, 0.3, -0.2, 0.1, -0.15),
             "alpha": (4e-4, -3e-4, 2e-4, 5e-4, -4e-4, 0.0),
             "theta": (0.0, 1e-3, -8e-4, 6e-4, -3e-4, 0.0)}


def far_from_singular(arm, joints):
    return float(arm.singularity_margins(joints).least_deg) > 2.0


@pytest.mark.parametrize("model", sorted(PUBLISHED_MM))
def test_stretched_out_the_arm_reaches_the_sum_of_its_links(model):
    d1, a2, a3, d4, d5, d6 = PUBLISHED_MM[model]
    base_from_flange = arm_for(model).forward([0, 0, 0, 0, 0, 0])
    assert base_from_flange.translation == pytest.approx([a2 + a3, -d4 - d6, d1 - d5])


def test_an_unknown_model_is_refused_by_name():
    with pytest.raises(ValueError, match=r"'ur99'.*ur10e"):
        arm_for("ur99")


@given(models, st.lists(joint_vectors, min_size=1, max_size=4))
def test_many_joint_vectors_at_once_give_what_one_by_one_gives(model, several):
    arm = arm_for(model)
    together = arm.flanges(several)
    assert together.shape == (len(several), 4, 4)
    for matrix, joints in zip(together, several, strict=True):
        assert matrix == pytest.approx(arm.forward(joints).matrix, abs=1e-9)


@given(models, joint_vectors)
def test_every_solution_of_the_inverse_goes_back_to_the_pose(model, joints):
    arm = arm_for(model)
    assume(far_from_singular(arm, joints))
    wanted = arm.forward(joints)
    solutions = arm.inverse(wanted)
    assert len(solutions) in (2, 4, 6, 8)
    for solution in solutions:
        millimetres, radians = arm.forward(solution).distance(wanted)
        assert millimetres < 1e-7
        assert radians < 1e-9
    gaps = [np.abs(np.angle(np.exp(1j * (np.subtract(s, joints))))).max() for s in solutions]
    assert min(gaps) < 1e-7


@given(models, joint_vectors, st.tuples(*[st.booleans()] * 6))
def test_the_closest_solution_is_the_seed_itself_with_its_turns(model, joints, turned):
    arm = arm_for(model)
    assume(far_from_singular(arm, joints))
    seed = joints - 2 * np.pi * np.sign(joints) * turned
    assume(np.abs(seed).max() < 2 * np.pi - 1e-6)
    assert arm.closest(arm.forward(seed), seed) == pytest.approx(seed, abs=1e-7)


@given(joint_vectors)
def test_the_closest_solution_stays_within_the_joint_limits(joints):
    arm = arm_for("ur10e")
    assume(far_from_singular(arm, joints))
    seed = np.full(6, 6.2)
    found = arm.closest(arm.forward(joints), seed)
    assert np.abs(found).max() <= 2 * np.pi


def test_a_pose_out_of_reach_has_no_solution():
    arm = arm_for("ur5e")
    far = Transform.from_parts(np.eye(3), [2000.0, 100.0, 300.0])
    near_the_axis = Transform.from_parts(np.eye(3), [0.0, 20.0, 600.0])
    for pose in (far, near_the_axis):
        assert arm.inverse(pose) == ()
        assert arm.closest(pose, np.zeros(6)) is None


def test_a_singular_wrist_is_solved_too():
    arm = arm_for("ur10e")
    wanted = arm.forward([0.3, -1.2, 1.4, 0.2, 0.0, 0.5])
    solutions = arm.inverse(wanted)
    assert solutions
    for solution in solutions:
        assert arm.forward(solution).distance(wanted)[0] < 1e-6


@settings(max_examples=40)
@given(models, joint_vectors)
def test_a_calibrated_arm_is_solved_by_its_own_rows(model, joints):
    calibrated = arm_for(model).with_residuals(**RESIDUALS)
    assume(float(calibrated.singularity_margins(joints).least_deg) > 8.0)
    wanted = calibrated.forward(joints)
    assert arm_for(model).forward(joints).distance(wanted)[0] > 0.05
    assert calibrated.closest(wanted, joints) == pytest.approx(joints, abs=1e-8)


def test_residuals_add_up_and_start_from_the_published_rows():
    arm = arm_for("ur5e").with_residuals(d=(1.0, 0, 0, 0, 0, 0)).with_residuals(d=(0.5,) + (0,) * 5)
    assert arm.d[0] == pytest.approx(164.0)
    assert arm.published == arm_for("ur5e")


@settings(max_examples=30)
@given(models, joint_vectors)
def test_the_jacobian_is_the_derivative_of_the_forward_kinematics(model, joints):
    arm = arm_for(model).with_residuals(**RESIDUALS)
    jacobian = arm.jacobian(joints)
    here = arm.forward(joints)
    moved = approx_fprime(joints, lambda q: arm.forward(q).translation, 1e-6)
    assert jacobian[:3] == pytest.approx(moved, abs=2e-2)
    for column in range(6):
        step = np.eye(6)[column] * 1e-5
        turn = arm.forward(joints + step).rotation @ here.rotation.T
        skew = (turn - turn.T) / 2e-5
        assert jacobian[3:, column] == pytest.approx([skew[2, 1], skew[0, 2], skew[1, 0]], abs=1e-5)


@pytest.mark.parametrize(("joints", "margin"), [
    ([0.4, -1.1, 1.3, 0.5, 0.0, 0.7], "wrist_deg"),
    ([0.4, -1.1, 1.3, 0.5, np.pi, 0.7], "wrist_deg"),
    ([0.4, -1.1, 0.0, 0.5, 1.2, 0.7], "elbow_deg"),
])
def test_a_singularity_has_no_margin_and_a_jacobian_without_inverse(joints, margin):
    arm = arm_for("ur10e")
    margins = arm.singularity_margins(joints)
    assert getattr(margins, margin) == pytest.approx(0.0, abs=1e-9)
    assert margins.least_deg == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.cond(_scaled(arm.jacobian(joints))) > 1e9


def test_the_shoulder_singularity_is_where_the_wrist_stands_over_the_base():
    arm = arm_for("ur10e")

    def radial(q2):
        wrist = arm.frames([0.0, q2, 2.0, -0.6, 1.2, 0.7])[5, :3, 3]
        return wrist[0]

    joints = [0.0, brentq(radial, -2.8, -1.2), 2.0, -0.6, 1.2, 0.7]
    assert arm.singularity_margins(joints).shoulder_deg == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.cond(_scaled(arm.jacobian(joints))) > 1e9


def test_margins_are_given_for_a_whole_path_at_once():
    path = np.linspace([0.1, -1.5, 1.0, -1.0, -0.5, 0.2], [0.3, -1.3, 1.2, -1.1, 0.5, 0.2], 11)
    margins = arm_for("ur5e").singularity_margins(path)
    assert margins.least_deg.shape == (11,)
    assert margins.wrist_deg[5] == pytest.approx(0.0, abs=1e-9)
    assert margins.wrist_deg[0] == pytest.approx(np.degrees(0.5))


@pytest.mark.parametrize("model", sorted(PUBLISHED_MM))
def test_an_independent_implementation_agrees(model):
    oracle = pytest.importorskip("ur_analytic_ik", reason="ur-analytic-ik is not installed")
    theirs, arm = getattr(oracle, model), arm_for(model)
    rng = np.random.default_rng(7)
    for joints in rng.uniform(-np.pi, np.pi, (40, 6)):
        ours = arm.forward(joints)
        in_metres = ours.matrix.copy()
        in_metres[:3, 3] /= 1000.0
        assert theirs.forward_kinematics(*joints) == pytest.approx(in_metres, abs=1e-12)
        solutions = np.array(theirs.inverse_kinematics(in_metres)).reshape(-1, 6)
        assert len(solutions) == len(arm.inverse(ours))


def _scaled(jacobian):
    return jacobian / np.array([[600.0]] * 3 + [[1.0]] * 3)
