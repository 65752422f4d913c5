"""Views that tell too little: they turn too little, or are too few."""


from spoilt_sessions import FINE, refused, session

from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye


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
