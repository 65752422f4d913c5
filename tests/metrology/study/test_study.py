"""Studies against the paper's table 1, closed forms, known truth, and their refusals."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from cell.metrology.study.nested import solve_components
from cell.metrology.study.studies import (
    StudyRefusedError,
    Type1Rule,
    sd_interval,
    solve_spread,
    solve_type1,
    solve_type3,
)

TABLE_1 = {
    "x": ([3390.8318, 3390.8185, 3390.8147, 3390.8258, 3390.7943], 0.0143),
    "y": ([-591.1496, -591.1471, -591.1535, -591.1533, -591.1505], 0.0027),
    "z": ([768.7088, 768.6957, 768.6960, 768.6916, 768.6867], 0.0082),
}


@pytest.mark.parametrize("axis", TABLE_1)
def test_the_papers_table_1_is_a_sample_standard_deviation(axis):
    values, printed = TABLE_1[axis]
    spread = solve_spread(values)
    assert round(spread.sd, 4) == printed
    assert spread.n == 5 and spread.sd_interval.low < spread.sd < spread.sd_interval.high
    assert spread.sd_interval.high / spread.sd == pytest.approx(math.sqrt(4 / 0.48442), rel=1e-4)


def test_table_1_as_transcribed_agrees_with_the_file(test_data):
    with (test_data / "paper" / "table1.csv").open() as lines:
        for row in csv.DictReader(lines):
            values = [float(row[f"run{run}_mm"]) for run in range(1, 6)]
            assert values == TABLE_1[row["axis"]][0]


def test_a_single_value_has_no_spread():
    with pytest.raises(StudyRefusedError, match="at least 2"):
        solve_spread([1.0])


@pytest.mark.parametrize(("freedom", "sd"), [(4, 1.0), (24, 0.3)])
def test_interval_of_a_standard_deviation_covers_as_often_as_it_says(freedom, sd):
    chance = np.random.default_rng(7)
    found = chance.normal(4.0, sd, (4000, freedom + 1)).std(axis=1, ddof=1)
    unit = sd_interval(1.0, freedom, 0.95)
    covered = np.mean((found * unit.low <= sd) & (sd <= found * unit.high))
    assert abs(covered - 0.95) < 0.012


def _values(n, mean, sd):
    values = np.random.default_rng(3).normal(size=n)
    return mean + sd * (values - values.mean()) / values.std(ddof=1)


def test_type1_of_the_papers_spread_fails_by_its_bias_and_not_by_its_noise():
    found = solve_type1(_values(50, 3390.86 + 0.05, 0.01431), 3390.86, 1.0)
    assert (round(found.cg, 2), round(found.cgk, 2)) == (2.33, 1.16)
    assert not found.capable and found.bias_significant
    assert found.cg_low < found.cg and found.cgk_low < found.cgk
    assert found.smallest_tolerance == pytest.approx(39.9 * 0.01431, rel=1e-6)


def test_type1_follows_the_customers_factors():
    values = _values(30, 10.0, 0.02)
    strict, loose = solve_type1(values, 10.0, 1.0), solve_type1(values, 10.0, 1.0,
                                                                Type1Rule(0.15, 4.0, 1.0))
    assert loose.cg == pytest.approx(strict.cg * (0.15 / 0.2) * (6 / 4))
    assert loose.capable and strict.cgk == pytest.approx(strict.cg)
    assert not strict.bias_significant and strict.bias_p == pytest.approx(1.0)


@pytest.mark.parametrize("bias", [0.0, 0.03])
def test_lower_bounds_of_type1_hold_for_95_of_100_studies(bias):
    chance, sd, tolerance = np.random.default_rng(11), 0.02, 1.0
    true = np.array([0.2 * tolerance / (6 * sd), (0.1 * tolerance - bias) / (3 * sd)])
    studies = [solve_type1(chance.normal(5.0 + bias, sd, 25), 5.0, tolerance) for _ in range(1500)]
    held = np.mean([[s.cg_low <= true[0], s.cgk_low <= true[1]] for s in studies], axis=0)
    assert abs(held[0] - 0.95) < 0.02 and held[1] > 0.93


def test_too_few_values_and_a_frozen_value_carry_no_index():
    with pytest.raises(StudyRefusedError, match="24 values"):
        solve_type1(_values(24, 1.0, 0.1), 1.0, 1.0)
    with pytest.raises(StudyRefusedError, match="frozen"):
        solve_type1(np.full(50, 1.0), 1.0, 1.0)


def test_type3_agrees_with_the_closed_form_of_two_trials():
    chance = np.random.default_rng(5)
    table = chance.normal(20.0, 0.3, (25, 1)) + chance.normal(0.0, 0.02, (25, 2))
    found = solve_type3(list(table), 1.0)
    differences = table[:, 0] - table[:, 1]
    assert_allclose(found.ev, np.sqrt(np.mean(differences**2) / 2))
    assert_allclose(found.grr_percent, 600 * found.ev)
    assert found.judgement == "conditional" and found.ndc > 5
    assert found.grr_percent_interval.low < found.grr_percent < found.grr_percent_interval.high


@pytest.mark.parametrize(("table", "words"), [
    ([[1.0, 2.0]] * 4, "at least 5"), ([[1.0]] * 6, "measured once"),
    ([[1.0, 2.0]] * 5 + [[1.0]], "same number"),
])
def test_type3_refuses_what_cannot_be_split(table, words):
    with pytest.raises(StudyRefusedError, match=words):
        solve_type3([np.array(row) for row in table], 1.0)


def _nested(chance, sds, shape):
    table = (chance.normal(0, sds[2], (*shape[:1], 1, 1))
             + chance.normal(0, sds[1], (*shape[:2], 1))
             + chance.normal(0, sds[0], shape))
    labels = np.indices(shape)
    return (817.3 + table.ravel(), [f"a{k}" for k in labels[1].ravel()],
            [f"l{k}" for k in labels[0].ravel()])


def test_the_split_finds_the_share_of_sensor_robot_and_location():
    sds = (0.01, 0.03, 0.08)
    values, approaches, locations = _nested(np.random.default_rng(2), sds, (60, 12, 5))
    parts = solve_components(values, approaches, locations)
    assert [part.cause for part in parts] == ["sensor", "robot", "location"]
    for part, sd in zip(parts, sds, strict=True):
        assert part.sd == pytest.approx(sd, rel=0.2)
        assert part.interval.low < sd < part.interval.high


def test_the_split_counts_right_when_measurements_are_missing():
    sds, chance, found = (0.02, 0.03, 0.05), np.random.default_rng(8), []
    for _ in range(150):
        values, approaches, locations = _nested(chance, sds, (8, 4, 3))
        kept = np.flatnonzero(chance.random(values.size) > 0.25)
        parts = solve_components(values[kept], [approaches[i] for i in kept],
                                 [locations[i] for i in kept])
        found.append([part.sd**2 for part in parts])
    assert_allclose(np.sqrt(np.mean(found, axis=0)), sds, rtol=0.08)


def test_bounds_of_the_split_cover_as_often_as_they_say():
    sds, chance, inside = (0.02, 0.02, 0.02), np.random.default_rng(9), []
    for _ in range(400):
        parts = solve_components(*_nested(chance, sds, (6, 3, 3)))
        inside.append([p.interval.low <= sd <= p.interval.high
                       for p, sd in zip(parts, sds, strict=True)])
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.035)


def test_without_locations_the_split_stops_at_the_robot():
    values, approaches, _ = _nested(np.random.default_rng(4), (0.01, 0.02, 0.0), (1, 10, 4))
    assert [part.cause for part in solve_components(values, approaches)] == ["sensor", "robot"]


def test_a_split_without_repeats_or_with_one_location_is_refused():
    with pytest.raises(StudyRefusedError, match="repeats"):
        solve_components([1.0, 2.0, 3.0], ["a", "b", "c"])
    with pytest.raises(StudyRefusedError, match="two locations"):
        solve_components([1.0, 1.1, 2.0, 2.2], list("aabb"), list("llll"))


@given(st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=4), st.floats(-1e5, 1e5))
def test_moving_all_values_moves_nothing_but_the_mean(values, shift):
    there, here = np.array(values) + shift, np.array(values)
    assert_allclose(solve_spread(there).sd, solve_spread(here).sd, atol=1e-6 * (1 + abs(shift)))
    parts = [solve_components(v, list("aabb")) for v in (there, here)]
    assert_allclose(parts[0][1].sd, parts[1][1].sd, atol=1e-3 * (1 + abs(shift)) ** 0.5)
