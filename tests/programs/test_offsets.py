"""`cell study offsets` over recordings of a master body, and the offsets at work."""

import dataclasses
import json
import shutil
import sys

import numpy as np
import pytest
from made_workplace import Workplace, workplace

from cell.cli import main
from cell.core.documents.record import Attempt, HoleRecord, Start, Stop
from cell.core.documents.result import Located, Measured
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.core.observation import Observation, View
from cell.metrology.judge.decide import judge_run
from cell.programs.offsets import study_offsets, write_offsets
from cell.recording import Recorder
from cell.recording.seal import seal_path

__all__ = ["workplace"]

DAY = 86_400.0
MONDAY = 1_795_305_600.0  # 2026-11-22, UTC
NOISE = 0.01
BUDGET = {"robot": (0.1, 0.1, 0.1, 0.0), "hand_eye": (0.06, 0.06, 0.06, 0.0)}


def bias_of(hole):
    return np.random.default_rng([*hole.id.encode()]).normal(0.0, 0.15, 4)


def joints_of(hole):
    turn = np.random.default_rng([*hole.id.encode()]).normal(0.0, 0.2, 6)
    return tuple(np.radians([150.0, -90.0, 110.0, -10.0, 60.0, 160.0]) + turn)


def cmm_of(hole):
    return np.array([hole.cmm[axis] for axis in "xyzd"])


def measured(hole, true, rng):
    """What a sensor says that is wrong by the hole's bias, and knows how far it may be wrong."""
    found = true + bias_of(hole) + NOISE * rng.normal(size=4)
    located = Located("joint", np.array([0.0, 0.0, 242.0]), hole.radius, None, np.eye(4))
    covariance = np.diag(NOISE**2 + np.square(list(BUDGET.values())).sum(axis=0))
    return Measured(hole.id, found[:3], found[3], covariance, None, located, located, 0, BUDGET)


def record(path, papers, *, truth=cmm_of, body="MASTER", seed=0, missing=(), status="complete",
           **changes):
    """Record a body; `truth` gives the true x, y, z, d of a hole that the CMM knows."""
    rng = np.random.default_rng([seed, 77])
    start = Start(path.stem, body, MONDAY + DAY * seed, papers.set_id, papers.texts, {}, {})
    start = dataclasses.replace(start, **changes)
    recorder, records = Recorder(path, start), []
    image, here = np.full((2, 3), seed, np.uint8), Transform.identity()
    for hole in papers.planned_holes:
        if hole.cmm and hole.id not in missing:
            views = (View(image, "ring", 0.01, 0.0, here, here, joints_of(hole)),)
            outcome = measured(hole, truth(hole), rng)
            records.append(HoleRecord(len(records), Observation(hole.id, views, here),
                                      (Attempt(1, outcome),)))
            recorder.write_hole(records[-1])
    recorder.finish(Stop(status, start.started + 60.0, len(records),
                         result=judge_run(papers, start, records)))
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Four runs over the master body, with the demo's papers."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        papers = Workplace.in_folder(folder).papers()
        (folder / "logs").mkdir()
        for index in range(4):
            record(folder / "logs" / f"m{index}.rrd", papers, seed=index)
    return folder / "logs"


@pytest.fixture
def masters(workplace, recorded):
    logs = shutil.copytree(recorded, workplace.folder / "logs")
    return sorted(logs.glob("*.rrd"))


def cell(*words):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["cell", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
    return left.value.code or 0


def another_body(hole):
    """The truth of a body that is not the master."""
    return cmm_of(hole) + np.random.default_rng([5, *hole.id.encode()]).normal(0, 0.3, 4)


def errors(papers, log_path):
    """Errors against the truth, and the uncertainties, of all holes and axes of a new body."""
    from cell.recording import read

    recording = read(record(log_path, papers, truth=another_body, body="B1", seed=9))
    features = [feature for feature in recording.stop.result.features if feature.measured]
    gaps = [[feature.measured[axis] - true for axis, true in
             zip("xyzd", another_body(papers.hole(feature.id)), strict=True)]
            for feature in features]
    return np.array(gaps), np.array([[feature.uncertainty[axis] for axis in "xyzd"]
                                     for feature in features])


def test_offsets_learnt_on_the_master_put_another_body_right(workplace, masters):
    before, wide = errors(workplace.papers(), workplace.folder / "logs" / "before.rrd")
    learnt = study_offsets(masters, days=30, by="M. Meier")
    write_offsets(learnt.study, learnt.place)
    papers = workplace.papers()
    assert papers.offsets == learnt.study.document
    after, narrow = errors(papers, workplace.folder / "logs" / "after.rrd")
    print(f"\nmean |error| {np.abs(before).mean():.4f} -> {np.abs(after).mean():.4f} mm")
    assert np.abs(after).mean() < 0.2 * np.abs(before).mean()
    assert 0.4 < np.sqrt(np.mean((after / narrow)**2)) < 1.1  # the CMM is exact here
    assert narrow[:, :3].max() < 0.3 * wide[:, :3].min()


def test_offsets_that_held_while_learning_are_taken_out(workplace, masters):
    first = study_offsets(masters, days=30)
    write_offsets(first.study, first.place)
    again = [record(workplace.folder / "logs" / f"again{index}.rrd", workplace.papers(),
                    seed=index) for index in range(4)]
    assert study_offsets(again, days=30).study.document == first.study.document


def test_the_command_writes_the_file_and_says_one_object(workplace, masters, capsys):
    out = workplace.cell / "offsets" / "demo.yaml"
    assert cell("study", "offsets", *masters, "--out", out, "--expires", 10, "--by", "M. Meier",
                "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["job"], answer["body"], answer["expires"]) == ("demo", "MASTER", "2026-12-05")
    assert len(answer["offsets"][0]["measured_mm"]) == 4
    assert answer["left_out"]["BP3"] == "no CMM values in the nominals"
    assert workplace.papers().offsets.offsets[0].by == "M. Meier"
    assert cell("study", "offsets", *masters, "--out", out) == 2
    assert "--replace" in capsys.readouterr().err
    assert cell("study", "offsets", *masters, "--out", out, "--replace") == 0
    said = capsys.readouterr().out
    assert "BP1" in said
    assert "left out: BP3" in said


def test_a_hole_that_the_cmm_knows_and_nobody_measured_ends_with_1(workplace, capsys):
    (workplace.folder / "logs").mkdir()
    logs = [record(workplace.folder / "logs" / f"m{index}.rrd", workplace.papers(), seed=index,
                   missing=("BP5",)) for index in range(3)]
    assert cell("study", "offsets", *logs) == 1
    said = capsys.readouterr()
    assert "left out: BP5: measured in 0 of 3 runs" in said.out
    assert "nothing written" in said.err


@pytest.mark.parametrize(("changes", "words"), [
    ({"body": "ANOTHER"}, "is of the body ANOTHER"),
    ({"set_id": "2026-10-01b"}, "is of the calibration set 2026-10-01b"),
    ({"status": "interrupted"}, "ended: interrupted"),
    ({"recording_id": "m0"}, "the same run stands twice"),
])
def test_what_does_not_belong_is_refused(workplace, masters, changes, words):
    papers = workplace.papers()
    if "set_id" in changes:
        texts = papers.texts | {"body": papers.texts["body"].replace(papers.set_id,
                                                                     changes["set_id"])}
        papers = dataclasses.replace(papers, texts=texts)
    odd = record(workplace.folder / "logs" / "odd.rrd", papers, seed=7, **changes)
    with pytest.raises(DocumentError, match=words):
        study_offsets([*masters, odd], days=30)


def test_another_jobs_recording_and_changed_papers_are_refused(workplace, masters):
    papers = workplace.papers()
    for old, new, words in (("name: demo", "name: other", "is of the job other"),
                            ("# Left side", "# left side", "was run with another job than")):
        texts = papers.texts | {"job": papers.texts["job"].replace(old, new, 1)}
        odd = record(workplace.folder / "logs" / f"{new[-5:]}.rrd",
                     dataclasses.replace(papers, texts=texts), seed=8)
        with pytest.raises(DocumentError, match=words):
            study_offsets([*masters, odd], days=30)


def test_too_few_runs_are_refused(masters):
    with pytest.raises(DocumentError, match="at least 3 runs"):
        study_offsets(masters[:2], days=30)
    with pytest.raises(DocumentError, match="stands twice"):
        study_offsets([*masters[:2], masters[0]], days=30)


def test_altered_unsealed_and_absent_recordings_are_refused(masters):
    seal_path(masters[1]).unlink()
    with pytest.raises(DocumentError, match=r"m1\.rrd: not as it was sealed: unsealed"):
        study_offsets(masters, days=30)
    blob = bytearray(masters[0].read_bytes())
    blob[len(blob) // 2] ^= 0x40
    masters[0].write_bytes(bytes(blob))
    with pytest.raises(DocumentError, match=r"m0\.rrd: not as it was sealed: altered"):
        study_offsets(masters, days=30)
    masters[0].unlink()
    with pytest.raises(DocumentError, match=r"m0\.rrd: there is no such recording"):
        study_offsets(masters, days=30)
