"""The audit computes every number again, and finds every one that was changed."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from recorded_body import GOLDEN, measured_anew, record_body

from cell.core.documents.result import Measured
from cell.programs.audit.folder import audit_folder
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question, WhatIf
from cell.recording import read
from cell.recording.prune import prune
from cell.recording.rows import open_chunks
from cell.recording.seal import seal_path

UNSEALED = Question(unsealed=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CELL_SEAL_KEY", "/nowhere/seal.key")
        yield tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def log(folder):
    return record_body(folder / "body.rrd")


def with_outcome(index, **changes):
    """The holes, one of them with another final outcome than was measured."""
    _, holes = measured_anew()
    attempts = holes[index].attempts
    forged = replace(attempts[-1], outcome=replace(attempts[-1].outcome, **changes))
    changed = replace(holes[index], attempts=(*attempts[:-1], forged))
    return tuple(changed if hole is holes[index] else hole for hole in holes)


def alter(log):
    """Change one bit of the first hole's centre."""
    content = bytearray(log.read_bytes())
    place = content.find(measured_anew()[1][0].outcome.centre.tobytes())
    assert place > 0
    content[place + 3] ^= 1
    log.chmod(0o644)
    log.write_bytes(content)


def fields(audit, level="differs"):
    return [each.where for each in audit.differences if each.level == level]


def test_a_fresh_recording_comes_out_bit_for_bit(log):
    audit = audit_log(log)
    assert (audit.answer, audit.problem, audit.differences) == ("identical", None, ())
    assert (audit.exit_code(), audit.exit_code(strict=True), audit.holes) == (0, 0, 3)
    assert audit.numbers["identical"] > 5000
    assert audit.verdict == audit.verdict_then == "out_of_tolerance"
    assert {check.level: check.passed for check in audit.checks} == {
        "file": True, "signature": None, "link": True, "chain": True, "images": True,
        "records": True}


def test_a_refused_first_try_is_replayed_as_it_happened(log):
    retaken = read(log).holes[1]
    assert [type(attempt.outcome).__name__ for attempt in retaken.attempts] == [
        "NotMeasured", "Measured"]
    forged = replace(retaken, attempts=(replace(retaken.attempts[0], outcome=replace(
        retaken.attempts[0].outcome, reason="no_stripe")), retaken.attempts[1]))
    holes = tuple(forged if hole.index == forged.index else hole for hole in measured_anew()[1])
    audit = audit_log(record_body(log.parent / "reason.rrd", holes=holes))
    assert fields(audit) == [f"{retaken.observation.hole_id} attempt 0 outcome reason"]


def test_a_forged_diameter_differs_although_it_was_sealed(folder):
    true = measured_anew()[1][0].outcome
    audit = audit_log(record_body(folder / "forged.rrd",
                                  holes=with_outcome(0, diameter=true.diameter + 0.05)))
    assert audit.exit_code() == 1
    assert {f"{true.hole_id} attempt 0 outcome diameter",
            f"body features {true.hole_id} deviation d"} <= set(fields(audit))
    assert audit.differences[0].difference == pytest.approx(0.05)


def test_within_a_hundredth_of_its_uncertainty_it_is_reproduced(folder):
    true = measured_anew()[1][0].outcome
    u = float(np.sqrt(true.covariance[3, 3]))
    near = audit_log(record_body(folder / "near.rrd",
                                 holes=with_outcome(0, diameter=true.diameter + 0.009 * u)))
    far = audit_log(record_body(folder / "far.rrd",
                                holes=with_outcome(0, diameter=true.diameter + 0.011 * u)))
    assert (near.answer, near.exit_code(), near.exit_code(strict=True)) == ("reproduced", 0, 1)
    assert far.answer == "differs"


def test_a_forged_verdict_differs(folder):
    body = read(record_body(folder / "honest.rrd"))
    result = replace(body.stop.result, verdict="in_tolerance")
    audit = audit_log(record_body(folder / "verdict.rrd", result=result))
    assert fields(audit) == ["body verdict"]


def test_a_pose_that_is_moved_moves_the_result(folder):
    _, holes = measured_anew()
    view = holes[0].observation.views[0]
    moved = view.base_from_flange_before.matrix.copy()
    moved[0, 3] += 0.02
    shifted = type(view.base_from_flange_before)(moved)
    views = tuple(replace(each, base_from_flange_before=shifted, base_from_flange_after=shifted)
                  for each in holes[0].observation.views)
    forged = replace(holes[0], observation=replace(holes[0].observation, views=views))
    audit = audit_log(record_body(folder / "moved.rrd", holes=(forged, *holes[1:])))
    assert any(field.endswith("outcome centre") for field in fields(audit))


def test_an_unsealed_recording_is_refused_unless_told_otherwise(folder):
    log = record_body(folder / "unsealed.rrd")
    seal_path(log).unlink()
    audit = audit_log(log)
    assert (audit.answer, audit.exit_code()) == ("refused", 2)
    assert "unsealed" in audit.problem
    told = audit_log(log, UNSEALED)
    assert told.answer == "identical"
    assert "nothing sealed" in told.checks[1].words


def test_an_altered_recording_is_refused_and_the_chain_finds_it_even_unsealed(folder):
    log = record_body(folder / "altered.rrd")
    alter(log)
    assert "file: altered" in audit_log(log).problem
    told = audit_log(log, UNSEALED)
    assert told.exit_code() == 2
    assert "does not follow" in told.problem


@pytest.mark.parametrize(("change", "said"), [
    (lambda hole: {"index": 9}, "says that it is number 9, and is number 0"),
    (lambda hole: {"attempts": (replace(hole.attempts[0], views=9),)}, "after [9] of 2 views"),
    (lambda hole: {"attempts": (replace(hole.attempts[0], views=0),)}, "after [0] of 2 views"),
    (lambda hole: {"attempts": (hole.attempts[0], replace(hole.attempts[0], views=9))},
     "after [2, 9] of 2 views"),
    (lambda hole: {"observation": replace(hole.observation, hole_id="XX")},
     "not in the job's plan"),
])
def test_a_record_that_cannot_be_is_named(folder, change, said):
    """Whoever holds the key can seal anything: what is sealed must make sense as well."""
    first, *others = measured_anew()[1]
    log = record_body(folder / f"{abs(hash(said))}.rrd", holes=(replace(first, **change(first)),
                                                                *others))
    audit = audit_log(log)
    assert audit.exit_code() == 2
    assert said in audit.problem


def test_an_end_that_does_not_fit_the_holes_is_named(folder):
    holes = measured_anew()[1]
    short = record_body(folder / "short.rrd", holes=holes[:2], status="complete")
    assert "the run was complete, and lacks QP2" in audit_log(short).problem
    again = replace(holes[0], index=3)
    twice = record_body(folder / "twice.rrd", holes=(*holes, again))
    assert "hole BP2: is recorded 2 times" in audit_log(twice).problem


@pytest.fixture
def bug(monkeypatch):
    """A measuring function that is at fault."""
    def stumble(*_):
        raise KeyError("nowhere")

    monkeypatch.setattr("cell.programs.audit.log.measure_hole", stumble)


def test_a_bug_says_nothing_of_the_recording(log, bug):
    audit = audit_log(log)
    assert (audit.answer, audit.exit_code()) == ("failed", 70)
    assert audit.problem == "a fault of the program: KeyError('nowhere')"
    assert 'raise KeyError("nowhere")' in audit.traceback


def test_altered_content_that_cannot_be_measured_is_not_intact(folder, bug):
    """Whoever writes what no program would is no bug of this one."""
    log = record_body(folder / "twisted.rrd")
    alter(log)
    audit = audit_log(log, UNSEALED)
    assert (audit.answer, audit.exit_code(), audit.traceback) == ("refused", 2, "")
    assert audit.problem.startswith("not intact: altered")
    seal_path(log).unlink()
    assert "does not follow" in audit_log(log, UNSEALED).problem


def test_a_pruned_recording_keeps_its_chain_and_says_what_it_lost(folder):
    log = record_body(folder / "whole.rrd")
    pruned = log.with_name(prune(log).file)
    audit = audit_log(pruned)
    assert pruned.stat().st_size < log.stat().st_size / 5
    assert (audit.answer, audit.skipped, audit.holes) == ("identical", 3, 3)
    assert audit.chain == audit_log(log).chain
    assert {check.level: check.passed for check in audit.checks}["images"] is None
    measured = audit_log(pruned, Question(what_if=WhatIf(method="two-step")))
    assert (measured.answer, measured.exit_code()) == ("refused", 2)
    assert measured.problem == "3 holes cannot be measured otherwise: their images were pruned"
    nominals = read(log).start.papers["nominals"].replace(",2.0,2.0,2.0,", ",0.1,2.0,2.0,")
    assert "BP2" in audit_log(pruned, Question(what_if=WhatIf({"nominals": nominals}))).turning


def test_something_else_than_a_recording_is_refused_in_one_sentence(tmp_path):
    other = tmp_path / "notes.rrd"
    other.write_text("nothing of the kind")
    audit = audit_log(other, UNSEALED)
    assert audit.exit_code() == 2
    assert audit.problem == f"{other}: is not a recording: it does not begin with RRF2"


def test_what_if_the_plain_method_had_measured(log):
    before = log.read_bytes()
    audit = audit_log(log, Question(what_if=WhatIf(method="two-step")))
    assert {change.feature for change in audit.changes} == {"BP2", "SI3", "QP2"}
    for change in audit.changes:
        assert 0 < abs(change.deviation_then["d"] - change.deviation["d"]) < 0.05
    assert log.read_bytes() == before


def test_what_if_the_light_plane_had_drifted(log):
    """A plane 0.3 mm further away moves every hole along the optic axis and widens it."""
    start, _ = measured_anew()
    sensor = yaml.safe_load(start.papers["sensor"])
    coefficients = np.array(sensor["light_plane"])
    drifted = coefficients - [0, 0, 0, 0.3 * coefficients[2]]
    text = json.dumps(sensor | {"light_plane": drifted.tolist()})
    audit = audit_log(log, Question(what_if=WhatIf({"sensor": text})))
    for change in audit.changes:
        shift = [change.deviation_then[axis] - change.deviation[axis] for axis in "xyz"]
        assert np.linalg.norm(shift) == pytest.approx(0.3, abs=0.1)


def test_what_if_the_tolerances_were_tighter(log):
    nominals = measured_anew()[0].papers["nominals"].replace(",2.0,2.0,2.0,", ",0.1,2.0,2.0,")
    audit = audit_log(log, Question(what_if=WhatIf({"nominals": nominals})))
    turned = {change.feature: change.verdict_then for change in audit.changes if change.turns}
    assert turned["BP2"] == "out_of_tolerance"
    assert audit.exit_code() == 1


def test_a_body_that_turns_without_any_feature_changes(log):
    job = yaml.safe_load(measured_anew()[0].papers["job"])
    job["stops"] = [stop for stop in job["stops"] if stop["hole"] != "SI3"]
    audit = audit_log(log, Question(what_if=WhatIf({"job": json.dumps(job)})))
    assert (audit.verdict, audit.verdict_then, audit.turning) == (
        "out_of_tolerance", "in_tolerance", ())
    assert (audit.answer, audit.exit_code()) == ("changes", 1)


def test_both_results_are_saved_over_the_same_image_where_they_differ(folder):
    true = measured_anew()[1][0].outcome
    log = record_body(folder / "shown.rrd", holes=with_outcome(0, diameter=true.diameter + 0.05))
    before = log.read_bytes()
    audit_log(log, Question(save=True))
    with open_chunks(log.with_suffix(".audit.rrd")) as chunks:
        rows = {chunk.entity_path: chunk.num_rows for chunk in chunks}
    assert {rows[path] for path in ("/camera/ring", "/camera/ring/recorded", "/camera/ring/now",
                                    "/comparison")} == {1}
    assert log.read_bytes() == before
    assert not [finding for finding in audit_folder(folder).findings if "audit" in finding.file]
    again = audit_log(log, Question(save=True))
    assert "cannot be written: File exists" in again.problem
    assert (again.answer, again.exit_code()) == ("failed", 4)  # the recording is none the worse


def test_where_nothing_differs_no_picture_is_saved(log):
    assert audit_log(log, Question(save=True)).answer == "identical"
    assert not log.with_suffix(".audit.rrd").exists()


def test_the_recording_of_the_first_format_still_audits():
    audit, back = audit_log(GOLDEN), read(GOLDEN)
    accepted = json.loads(GOLDEN.with_suffix(".json").read_text())
    assert (audit.problem, audit.chain, back.start.schema) == (None, accepted["head"], 1)
    for feature in back.stop.result.features:
        assert feature.measured == accepted["features"][feature.id]["measured"]
        assert feature.verdict == accepted["features"][feature.id]["verdict"]
    for record, again in zip(back.holes, measured_anew()[1], strict=True):
        assert isinstance(again.outcome, Measured)
        u = np.sqrt(np.diag(record.outcome.covariance))
        assert (np.abs(record.outcome.centre - again.outcome.centre) < u[:3]).all()
        assert abs(record.outcome.diameter - again.outcome.diameter) < u[3]


def test_a_newer_format_is_refused_with_a_way_out(tmp_path):
    start = replace(measured_anew()[0], schema=2)
    audit = audit_log(record_body(tmp_path / "new.rrd", start=start))
    assert audit.exit_code() == 2
    assert "format 2" in audit.problem
    assert "install a newer one" in audit.problem
