"""Learning CMM offsets: from what is known to be wrong, back to it, with honest spreads."""

import dataclasses

import numpy as np
import pytest

from cell.core.documents.offsets import OffsetsDocument
from cell.core.documents.text import dump, parse
from cell.metrology.study.offsets import MasterRun, learn_offsets

SIGMA, STATED = 0.012, 0.15
STOP = np.radians([150.0, -90.0, 110.0, -10.0, 60.0, 160.0])


@pytest.fixture
def holes(workplace):
    return workplace.papers().planned_holes


def bias_of(hole):
    """What the sensor gets wrong at a hole: another value on every axis."""
    return dict(zip("xyzd", np.random.default_rng([*hole.id.encode()]).normal(0.0, 0.15, 4),
                    strict=True))


def made_runs(holes, count=4, noise=SIGMA, seed=3):
    rng = np.random.default_rng(seed)
    known = [hole for hole in holes if hole.cmm]
    return [MasterRun(f"2026-11-2{index}",
                      {hole.id: {axis: value + bias_of(hole)[axis] + noise * rng.normal()
                                 for axis, value in hole.cmm.items()} for hole in known},
                      {hole.id: dict.fromkeys("xyzd", STATED) for hole in known},
                      {hole.id: tuple(STOP + rng.normal(0, 1e-4, 6)) for hole in known})
            for index in range(count)]


def learn(holes, runs):
    return learn_offsets(runs, holes, "2026-12-31", "M. Meier")


def test_the_sensors_error_is_found_and_taken_with_the_opposite_sign(holes):
    study = learn(holes, made_runs(holes))
    known = {hole.id: hole for hole in holes if hole.cmm}
    assert {each.offset.hole for each in study.learnt} == set(known)
    assert len(study.learnt) == 4 * len(known)
    scaled = [(each.offset.value_mm + bias_of(known[each.offset.hole])[each.offset.axis])
              / np.hypot(SIGMA / 2, 1e-9) for each in study.learnt]
    assert np.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=0.25)
    assert np.mean([each.is_significant for each in study.learnt]) > 0.7


def test_every_offset_says_what_it_stands_on(holes):
    one = learn(holes, made_runs(holes)).learnt[0]
    differences = one.cmm - one.measured
    assert one.offset.value_mm == pytest.approx(differences.mean(), abs=1e-5)
    assert one.offset.spread_mm == pytest.approx(differences.std(ddof=1), abs=1e-5)
    assert (one.offset.sample_size, one.offset.by) == (4, "M. Meier")
    assert (one.offset.learnt, one.offset.expires) == ("2026-11-23", "2026-12-31")
    assert one.offset.joints_deg == pytest.approx(np.degrees(STOP), abs=0.02)
    assert one.offset.cmm_u_mm == 0.010
    assert one.u == pytest.approx(np.hypot(one.offset.repeatability / 2, 0.010))


def test_a_spread_that_is_small_by_luck_does_not_count(holes):
    offsets = [each.offset for each in learn(holes, made_runs(holes, count=3)).learnt]
    centres = [offset for offset in offsets if offset.axis != "d"]
    assert min(offset.spread_mm for offset in centres) < 0.5 * SIGMA
    assert all(offset.repeatability >= offset.spread_mm for offset in offsets)
    pooled = min(offset.repeatability for offset in centres)
    assert pooled == pytest.approx(SIGMA, rel=0.25)


def test_diameters_do_not_share_the_repeatability_of_centres(holes):
    runs = made_runs(holes)
    rng = np.random.default_rng(8)
    wild = [dataclasses.replace(run, values={name: values | {"x": values["x"] + rng.normal(0, 0.2)}
                                             for name, values in run.values.items()})
            for run in runs]
    offsets = [each.offset for each in learn(holes, wild).learnt]
    assert min(offset.repeatability for offset in offsets if offset.axis == "y") > 5 * SIGMA
    assert max(offset.repeatability for offset in offsets if offset.axis == "d") < 3 * SIGMA


def test_no_bias_is_rarely_significant(holes):
    known = [hole for hole in holes if hole.cmm]
    found = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        runs = [dataclasses.replace(run, values={
            hole.id: {axis: value + SIGMA * rng.normal() for axis, value in hole.cmm.items()}
            for hole in known}) for run in made_runs(holes)]
        found += [each.is_significant for each in learn(holes, runs).learnt]
    assert np.mean(found) == pytest.approx(0.05, abs=0.02)


def test_what_cannot_be_learnt_is_left_out_with_a_word(holes):
    runs = made_runs(holes)
    first, second = [hole.id for hole in holes if hole.cmm][:2]
    for run in runs[:2]:
        del run.values[first]
    runs[0] = dataclasses.replace(runs[0], joints=runs[0].joints | {
        second: tuple(STOP + np.radians([0, 0, 0, 0, 0, 3.0]))})
    study = learn(holes, runs)
    assert study.left_out[first] == "measured in 2 of 4 runs; at least 3 are needed"
    assert "stops 3.0 degrees apart" in study.left_out[second]
    assert study.left_out["BP3"] == "no CMM values in the nominals"
    assert not {first, second, "BP3"} & {each.offset.hole for each in study.learnt}


def test_axes_without_a_cmm_value_and_an_unstated_uncertainty(holes):
    hole = next(hole for hole in holes if hole.cmm)
    partial = dataclasses.replace(hole, cmm={axis: hole.cmm[axis] for axis in "xz"}, cmm_u=None)
    study = learn([partial], made_runs(holes))
    assert [each.offset.axis for each in study.learnt] == ["x", "z"]
    assert hole.id in study.remarks[0]
    assert study.learnt[0].offset.cmm_u_mm == 0.0


def test_more_than_the_sensor_admits_is_remarked(holes):
    """An offset must not hide a broken calibration."""
    runs = made_runs(holes)
    assert learn(holes, runs).remarks == ()
    first = next(hole for hole in holes if hole.cmm)
    for run in runs:
        run.values[first.id]["z"] += 0.9
    study = learn(holes, runs)
    assert f"explains: {first.id} z;" in study.remarks[0]
    assert [each.offset.axis for each in study.learnt if not each.is_explained] == ["z"]


def test_values_that_do_not_scatter_give_no_nonsense(holes):
    study = learn(holes, made_runs(holes, noise=0.0))
    assert all(each.p < 1e-6 for each in study.learnt)
    assert all(each.u >= 0.01 for each in study.learnt)


def test_the_document_reads_back_as_it_was(holes):
    document = learn(holes, made_runs(holes)).document
    assert parse(OffsetsDocument, dump(document), "offsets") == document
