import numpy as np
import pytest

from cell.metrology.study.drift import judge_drift

LIMITS = {"warn": 0.05, "act": 0.10, "stop": 0.20}
REFERENCE = {"a": np.array([500.0, -300.0, 0.0]), "b": np.array([900.0, -300.0, 50.0]),
             "c": np.array([700.0, 300.0, 400.0]), "d": np.array([500.0, 400.0, 20.0])}


def moved(shift, bend=0.0):
    now = {name: place + shift for name, place in REFERENCE.items()}
    now["c"] = now["c"] + [bend, 0.0, 0.0]
    return now


@pytest.mark.parametrize(("size", "alarm"), [(0.02, "ok"), (0.07, "warn"), (0.15, "act"),
                                             (0.25, "stop")])
def test_the_first_shift_counts_in_full(size, alarm):
    drift = judge_drift(REFERENCE, moved([0.0, size, 0.0]), [], LIMITS)
    assert drift.alarm == alarm
    assert drift.shifts["b"] == pytest.approx([0.0, size, 0.0])
    assert drift.reference_from_now.translation == pytest.approx([0.0, -size, 0.0], abs=1e-9)


def test_slow_drift_is_seen_below_the_scatter():
    rng, averages, alarms = np.random.default_rng(5), [], []
    for hour in range(30):
        now = moved([0.006 * hour, 0.0, 0.0])
        noisy = {name: place + rng.normal(0.0, 0.03, 3) for name, place in now.items()}
        drift = judge_drift(REFERENCE, noisy, averages, LIMITS)
        averages.append(drift.average)
        alarms.append(drift.alarm)
    assert alarms[0] == "ok" and alarms.index("warn") < alarms.index("act") < 28


def test_a_jump_is_repeated_before_it_is_believed():
    assert judge_drift(REFERENCE, moved([0.3, 0.0, 0.0]), [np.zeros(3)], LIMITS).alarm == "repeat"


def test_what_bends_is_not_corrected():
    straight = judge_drift(REFERENCE, moved([0.1, 0.0, 0.0]), [], LIMITS)
    bent = judge_drift(REFERENCE, moved([0.1, 0.0, 0.0], bend=0.5), [], LIMITS)
    far = judge_drift(REFERENCE, moved([0.4, 0.0, 0.0]), [], LIMITS)
    assert straight.correctable and straight.left_over < 1e-9
    assert not bent.correctable and bent.left_over > 0.1
    assert not far.correctable


def test_nothing_in_common_is_refused():
    with pytest.raises(ValueError, match="no artefact"):
        judge_drift(REFERENCE, {"other": np.zeros(3)}, [], LIMITS)
