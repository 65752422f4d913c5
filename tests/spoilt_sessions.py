"""Hand-eye sessions with a fault made on purpose, and what must be said of them."""

from dataclasses import replace

import numpy as np
from made_sessions import World

from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye
from cell.programs.calibration.recorded import read_gates

FINE = read_gates().fine


def session(seed=0, count=20, **world):
    return World(**world).session(np.random.default_rng(seed), count).as_recorded()


def refused(spoiled, code):
    answer = calibrate_hand_eye(spoiled, FINE)
    assert answer.verdict == "refuse"
    assert answer.findings[0].code == code, answer.reasons
    assert answer.reasons[0] == answer.findings[0].sentence
    return answer


def disturbed(good, change):
    poses = good.base_from_flange.copy()
    change(poses)
    return replace(good, base_from_flange=poses)
