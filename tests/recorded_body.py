"""A body that the virtual cell measured once: its observations, measured again with today's method.

The observations (images, poses, papers) are those of the golden recording; the outcomes are made
now, so that a test of the audit does not fail because the method became better.
"""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import yaml

from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start, Stop
from cell.metrology.judge.decide import judge_run
from cell.metrology.measure.hole import measure_hole
from cell.recording import Recorder, collect_versions, read

GOLDEN = Path(__file__).parent / "golden" / "schema_1.rrd"


@cache
def measured_anew() -> tuple[Start, tuple[HoleRecord, ...]]:
    """The start and the holes of the golden recording, with the outcomes of today."""
    seen = read(GOLDEN)
    papers = Papers.parse(seen.start.papers, seen.start.set_id)
    return (replace(seen.start, versions=collect_versions()),
            tuple(_measured(record, papers) for record in seen.holes))


def record_body(path: Path, start: Start | None = None, holes: tuple[HoleRecord, ...] | None = None,
                **changes) -> Path:
    """Write a recording as a run does, judgement included; `changes` are of the stop record."""
    began, measured = measured_anew()
    start = start or replace(began, recording_id=path.stem)
    holes = measured if holes is None else holes
    recorder = Recorder(path, start)
    for hole in holes:
        recorder.write_hole(hole)
    papers = Papers.parse(start.papers, start.set_id)
    whole = len(holes) == len(papers.planned_holes)
    recorder.finish(Stop(**{"status": "complete" if whole else "interrupted",
                            "finished": start.started + 9.0, "holes": len(holes),
                            "result": judge_run(papers, start, holes)} | changes))
    return path


def long_body(count: int) -> tuple[Start, tuple[HoleRecord, ...]]:
    """The start and the holes of a body with `count` holes of two views, two of them over again."""
    start, seen = measured_anew()
    table = start.papers["nominals"].splitlines()
    rows = {line.split(",")[0]: line.partition(",")[2] for line in table}
    holes = tuple(_renamed(seen[2 * (k % 2)], k) for k in range(count))
    names = [hole.observation.hole_id for hole in holes]
    job = yaml.safe_load(start.papers["job"]) | {"stops": [{"hole": name} for name in names]}
    nominals = [table[0], *(f"{name},{rows[name.partition('-')[0]]}" for name in names)]
    papers = start.papers | {"job": yaml.safe_dump(job), "nominals": "\n".join(nominals)}
    return replace(start, papers=papers), holes


def _renamed(record: HoleRecord, index: int) -> HoleRecord:
    name = f"{record.observation.hole_id}-{index}"
    attempts = tuple(replace(attempt, outcome=replace(attempt.outcome, hole_id=name))
                     for attempt in record.attempts)
    return HoleRecord(index, replace(record.observation, hole_id=name), attempts)


def abort(_path: Path) -> None:
    """Take the process down, as a foreign parser does over some damage."""
    os.abort()


def _measured(record: HoleRecord, papers: Papers) -> HoleRecord:
    hole = papers.hole(record.observation.hole_id)
    attempts = tuple(
        replace(attempt, outcome=measure_hole(
            record.observation.first(attempt.views), hole, papers.calibration, papers.job.method,
            np.radians(papers.job.normal_sigma_deg)))
        for attempt in record.attempts)
    return replace(record, attempts=attempts)
