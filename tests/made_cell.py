"""A cell that measures recorded bodies: everything of a shift but robot, camera and rendering.

Holes come out as planned beforehand; faults come where they are planted. The recordings are real
ones, with small images.
"""

import itertools
import secrets
import time
from pathlib import Path

import numpy as np

from cell.archive.papers import read_papers
from cell.core.documents.job import Decision
from cell.core.documents.nominals import Hole
from cell.core.documents.record import Attempt, HoleRecord, Start, Stop
from cell.core.documents.result import BodyResult, Feature, Located, Measured, NotMeasured
from cell.core.geometry import Transform
from cell.core.observation import Observation, View
from cell.metrology.judge.decide import judge_axis, judge_run
from cell.programs.approve import approval_hashes
from cell.programs.shift.work import Begun, PreparedJob
from cell.recording import Recorder
from cell.recording.seal import read_seal, seal_path

HOLES = 6
TEXTS = {"job": "recorded", "nominals": "recorded", "cell": "recorded", "sensor": "recorded",
         "hand_eye": "recorded", "body": "recorded"}


def made_hole(number: int, importance: str = "") -> Hole:
    return Hole(f"H{number}", np.array([100.0 * number, -500.0, 40.0]), np.array([0.0, -1.0, 0.0]),
                10.0, 1.0, "camera", frozenset("xyd"), tolerance={"x": 0.5, "y": 0.5, "d": 0.2},
                importance=importance)


def demo_papers():
    """The papers of the demo job: what a recording needs to be judged again."""
    here = Path(__file__).parents[1]
    return read_papers(here / "jobs" / "demo.yaml", calibration=here / "calibration").parse()


def demo_job(papers):
    return PreparedJob(papers.job.name, papers.planned_holes, frozenset(),
                       approval_hashes(papers.texts))


def made_job(name="demo", holes=HOLES, datums=(), importance=lambda n: "") -> PreparedJob:
    return PreparedJob(name, tuple(made_hole(n, importance(n)) for n in range(holes)),
                       frozenset(datums), {"job": f"{name}-job", "calibration": "calibration"})


class RecordedCell:
    """Implements `cell.programs.shift.work.Cell` over recorded bodies.

    `deviation(body_number, hole_number)` gives a hole's deviation in x, or a reason as text.
    `plant(body_number, hole_number)` is called before each hole and may raise what a device would.
    """

    name = "recorded"

    def __init__(self, jobs, folder: Path | None = None, deviation=lambda body, hole: 0.05,
                 plant=lambda body, hole: None, papers=None):
        self.jobs, self.folder, self.papers = jobs, folder, papers
        if papers:
            self.name = papers.station.name
        self.deviation, self.plant = deviation, plant
        self.bodies = itertools.count(1)
        self.safe = self.recovered = self.homes = 0
        self.unrecoverable = []

    def begin(self, job, body_id, *, trial):
        recording_id = f"{job.name}_{secrets.token_hex(6)}"
        texts, set_id = (self.papers.texts, self.papers.set_id) if self.papers else (TEXTS, "set-1")
        start = Start(recording_id, body_id, time.time(), set_id, texts, {}, {}, trial=trial)
        recorder = Recorder(self.folder / f"{recording_id}.rrd", start) if self.folder else None
        inspection = RecordedInspection(self, job, start, recorder, next(self.bodies))
        return Begun(start, inspection, lambda: self._chain(recording_id))

    def _chain(self, recording_id):
        if self.folder is None:
            return ""
        return read_seal(seal_path(self.folder / f"{recording_id}.rrd")).chain

    def go_home(self):
        self.plant(0, "start")

    def make_safe(self):
        self.safe += 1

    def recover(self):
        self.recovered += 1
        if self.unrecoverable:
            raise self.unrecoverable.pop(0)


class RecordedInspection:
    """One body of a `RecordedCell`."""

    def __init__(self, cell, job, start, recorder, number):
        self.cell, self.job, self.start = cell, job, start
        self.recorder, self.number, self.records = recorder, number, []

    @property
    def result(self):
        if self.cell.papers:
            return judge_run(self.cell.papers, self.start, self.records)
        return judge_recorded(self.job, [record.outcome for record in self.records])

    def measure_remaining(self, wanted):
        for index in range(len(self.records), len(self.job.holes)):
            hole = self.job.holes[index]
            record = self._record(index, hole, wanted(hole))
            if self.recorder:
                self.recorder.write_hole(record)
            self.records.append(record)

    def _record(self, index, hole, wanted):
        if wanted:
            self.cell.plant(self.number, index)
            found = self.cell.deviation(self.number, index)
            outcome = made_outcome(hole, found)
        else:
            outcome = NotMeasured(hole.id, "dropped", "left out for the takt")
        here = Transform.from_parts(np.zeros(3), [1.0, 2.0, 3.0])
        image = np.full((4, 6), index, np.uint8)
        views = tuple(View(image, light, 0.01, time.time(), here, here, (0.0,) * 6)
                      for light in ("ring", "laser"))
        return HoleRecord(index, Observation(hole.id, views, here), (Attempt(2, outcome),))

    def go_home(self):
        self.cell.plant(self.number, "home")
        self.cell.homes += 1

    def finish(self, status, reason=""):
        stop = Stop(status, time.time(), len(self.records), reason, self.result)
        if self.recorder:
            self.recorder.finish(stop)
        return stop

    def abandon(self, status, reason):
        self.cell.make_safe()
        return self.finish(status, reason)


def made_outcome(hole, found):
    if isinstance(found, str):
        return NotMeasured(hole.id, found, "as it was recorded")
    located = Located("joint", np.zeros(3), 5.0, None, 1e-4 * np.eye(4))
    centre = hole.centre + np.array([found, 0.1 * found, 0.0])
    return Measured(hole.id, centre, hole.diameter, 1e-4 * np.eye(4), None, located, located, 0)


def judge_recorded(job, outcomes):
    """Judge as the application does, axis by axis, without alignment."""
    seen = {outcome.hole_id: outcome for outcome in outcomes}
    features = tuple(_feature(hole, seen.get(hole.id, NotMeasured(hole.id, "not_reached", "")))
                     for hole in job.holes)
    verdicts = {feature.verdict for feature in features}
    verdict = ("out_of_tolerance" if "out_of_tolerance" in verdicts else
               "incomplete" if "not_measured" in verdicts else "in_tolerance")
    return BodyResult(verdict, features)


def _feature(hole, outcome):
    if isinstance(outcome, NotMeasured):
        return Feature(hole.id, "not_measured", outcome, hole.nominal, hole.tolerance)
    values = dict(zip("xyzd", (*outcome.centre, outcome.diameter), strict=True))
    deviation = {axis: float(values[axis] - hole.nominal[axis]) for axis in hole.nominal}
    verdicts = {axis: judge_axis(deviation[axis], hole.tolerance[axis], 0.01, Decision())
                for axis in deviation}
    worst = max(verdicts.values(), key=["in_tolerance", "out_of_tolerance"].index)
    return Feature(hole.id, worst, outcome, hole.nominal, hole.tolerance,
                   {k: float(v) for k, v in values.items()}, deviation,
                   dict.fromkeys("xyzd", 0.01), verdicts)


def once(error, body, hole):
    """Plant one failure before one hole of one body."""
    waiting = [error]

    def plant(at_body, at_hole):
        if (at_body, at_hole) == (body, hole) and waiting:
            raise waiting.pop()
    return plant
