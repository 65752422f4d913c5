"""Residual kinematics in measuring: an arm that is off, measured with and without what is known."""

from dataclasses import replace

import numpy as np
import pytest
from made_observations import BASE_FROM_BODY, Sight, made_calibration, rows
from made_pairs import draw_scene
from pydantic import ValidationError

from cell.core.documents.calibration import BodyDocument, KinematicsDocument
from cell.core.documents.result import Measured
from cell.core.geometry import Transform
from cell.metrology.measure.arm_correction import correct_flange
from cell.metrology.measure.body_frame import reached
from cell.metrology.measure.hole import measure_hole
from cell.sim.arm import TrueArm
from cell.sim.scene import ArmScene

ARM = TrueArm(ArmScene(model="ur10e", length_mm=0.1, angle_deg=0.02), 5)
NOTHING = (0.0,) * 6
NOMINAL = KinematicsDocument(model="ur10e", a=NOTHING, d=NOTHING, alpha=NOTHING, theta=NOTHING)
SEED_JOINTS = np.radians([150.0, -90.0, 110.0, -10.0, 60.0, 160.0])
WARM = 1e9  # s
SIGMA = 0.0061
PLACES = [Transform.from_parts(turn, place) for turn, place in (
    ([1.4, 0.2, -0.1], [820.0, 260.0, 520.0]), ([1.2, -0.3, 0.4], [-310.0, 870.0, 310.0]),
    ([1.7, 0.1, 0.2], [560.0, 640.0, 720.0]), ([1.5, -0.1, -0.5], [990.0, -150.0, 180.0]))]


def residuals_of(arm):
    """What a perfect kinematic calibration of the arm would say."""
    gaps = {name: tuple(float(gap) for gap in np.subtract(getattr(arm.warm, name),
                                                          getattr(arm.model, name)))
            for name in ("a", "d", "alpha", "theta")}
    return KinematicsDocument(model="ur10e", **gaps)


TRUE = residuals_of(ARM)


def by_the_arm(view, base_from_room):
    """Have the arm bring the camera where a view was taken from; it reports what it believes."""
    true = base_from_room @ view.base_from_flange_before
    joints = ARM.warm.closest(true, SEED_JOINTS)
    assert joints is not None
    reported = ARM.model.forward(joints)
    ARM.follow(np.array(joints), WARM)
    assert ARM.flange(reported, np.array(joints), WARM).distance(true)[0] < 1e-6
    return replace(view, base_from_flange_before=reported, base_from_flange_after=reported,
                   joints=joints)


@pytest.fixture(scope="module")
def seen():
    """Four shifted and tilted holes, each elsewhere: sight, observation, calibration."""
    rng = np.random.default_rng(31)
    found = []
    for base_from_room in PLACES:
        sight = Sight(draw_scene(rng, radius=5.0, tilt_deg=3.0), np.array([0.4, -0.3, 0.5]))
        views = tuple(by_the_arm(view, base_from_room) for view in sight.attempt(rng))
        body = BodyDocument(base_from_body=rows((base_from_room @ BASE_FROM_BODY).matrix))
        found.append((sight, sight.observe(views), replace(made_calibration(), body=body)))
    return found


def outcomes(seen, kinematics):
    return [measure_hole(observation, sight.hole, replace(calibration, kinematics=kinematics),
                         "joint", SIGMA) for sight, observation, calibration in seen]


def errors(seen, kinematics):
    return np.array([np.linalg.norm(outcome.centre - sight.centre_in_body)
                     for outcome, (sight, *_) in zip(outcomes(seen, kinematics), seen,
                                                     strict=True)])


def test_the_true_residuals_bring_the_centres_to_the_truth(seen):
    plain, corrected = errors(seen, None), errors(seen, TRUE)
    print(f"\nplain {plain.round(3)}, corrected {corrected.round(3)} mm, "
          f"ratio {np.mean(plain) / np.mean(corrected):.0f}")
    assert plain.min() > 0.1
    assert corrected.max() < 0.03
    assert np.mean(plain) > 10.0 * np.mean(corrected)


def test_residuals_the_wrong_way_round_double_the_error(seen):
    inverted = TRUE.model_copy(update={name: tuple(-gap for gap in getattr(TRUE, name))
                                       for name in ("a", "d", "alpha", "theta")})
    assert errors(seen, inverted) == pytest.approx(2.0 * errors(seen, None), rel=0.15)


def test_kinematics_that_correct_nothing_change_nothing_to_the_bit(seen):
    for plain, nominal in zip(outcomes(seen, None), outcomes(seen, NOMINAL), strict=True):
        assert isinstance(plain, Measured)
        assert plain.centre.tobytes() == nominal.centre.tobytes()
        assert plain.covariance.tobytes() == nominal.covariance.tobytes()
        assert plain.budget == nominal.budget


def test_the_pose_as_reported_is_corrected_not_replaced():
    """A factory calibration that nobody knows stays in the pose: 2 mm, 0.3 degrees of it."""
    view = Sight(draw_scene(np.random.default_rng(2), radius=5.0), np.zeros(3)).view(
        "ring", np.random.default_rng(3))
    factory = Transform.from_parts([0.003, -0.002, 0.004], [1.1, -1.3, 0.9])
    reported = factory @ ARM.model.forward(SEED_JOINTS)
    view = replace(view, base_from_flange_before=reported, base_from_flange_after=reported,
                   joints=tuple(SEED_JOINTS))
    millimetres, radians = reached(view, TRUE).distance(factory @ ARM.warm.forward(SEED_JOINTS))
    assert millimetres < 1e-9
    assert radians < 1e-9
    assert reached(view, TRUE).distance(reached(view))[0] > 0.1


def test_what_kinematics_leave_stands_for_the_robots_share(seen):
    known = TRUE.model_copy(update={"remaining_mm": 0.01, "remaining_deg": 0.0})
    for before, after in zip(outcomes(seen, TRUE), outcomes(seen, known), strict=True):
        assert before.budget["robot"][:3] == pytest.approx([0.02] * 3)
        assert after.budget["robot"][:3] == pytest.approx([0.01] * 3)
        assert after.budget["hand_eye"] == before.budget["hand_eye"]
        assert after.covariance[:3, :3].trace() < before.covariance[:3, :3].trace()


@pytest.mark.parametrize("half", ["remaining_mm", "remaining_deg"])
def test_half_of_what_remains_is_refused(half):
    with pytest.raises(ValidationError, match="or neither"):
        KinematicsDocument(**NOMINAL.model_dump(exclude_none=True), **{half: 0.02})


def test_an_unknown_arm_has_no_kinematics():
    other = TRUE.model_copy(update={"model": "ur99"})
    with pytest.raises(ValueError, match="unknown arm"):
        correct_flange(Transform.identity(), SEED_JOINTS, other)
