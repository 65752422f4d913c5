"""Check a job: everything that can be known before anything moves."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.archive.logs import check_logs
from cell.archive.papers import read_papers
from cell.core.documents.papers import Papers
from cell.core.documents.station import StationDocument
from cell.core.errors import DocumentError
from cell.core.kinematics import arm_for
from cell.metrology.judge.align import check_alignment
from cell.metrology.judge.datum import UndeterminedError
from cell.metrology.judge.decide import Circumstances, sort_offsets
from cell.metrology.plan.stops import Plan, PlannedStop, draw_plan
from cell.recording.room import check_recordable


@dataclass(frozen=True)
class CheckedStop:
    """One stop, and the worst on the way to it: mm, degrees, seconds."""

    stop: PlannedStop
    clearance: float
    obstacle: str
    singularity_deg: float
    limit_deg: float
    seconds: float


@dataclass(frozen=True, eq=False)
class CheckedJob:
    """A job whose documents are right; the plan may still have refusals.

    `stale_offsets` are CMM offsets that would not be applied, with the reason; `seconds` predicts
    the station time, detecting and measuring not included.
    """

    papers: Papers
    plan: Plan
    stops: tuple[CheckedStop, ...]
    stale_offsets: Mapping[str, str]
    seconds: float

    @property
    def not_visited(self) -> tuple[str, ...]:
        """Holes of the nominals for which the job has no stop: nobody measures or judges them."""
        visited = {stop.hole for stop in self.papers.job.stops}
        return tuple(hole.id for hole in self.papers.holes if visited and hole.id not in visited)


def check_job(job: Path, cell: str | None = None, logs: Path = Path("logs")) -> CheckedJob:
    """Check documents, the folder of recordings, every stop and the whole way.

    Raises:
        DocumentError: a document is wrong, or recordings could not be written.
    """
    papers = read_papers(job, cell).parse()
    check_logs(logs)
    check_recordable(logs)
    try:
        check_alignment(papers.job.alignment, papers.holes)
    except UndeterminedError as loose:
        raise DocumentError(str(loose), source=str(job), place="alignment") from None
    plan = draw_plan(papers.job, papers.holes, papers.calibration, papers.station,
                     arm_for(papers.station.robot.model))
    stops = tuple(_check_stop(stop, plan, papers.station) for stop in plan.stops)
    today = Circumstances(day=time.strftime("%Y-%m-%d", time.gmtime()),
                          reached={stop.hole.id: stop.joints for stop in plan.stops})
    motion = sum(passage.leg.duration(papers.station.robot) for passage in plan.passages)
    return CheckedJob(papers, plan, stops, sort_offsets(papers, today)[1],
                      motion + len(stops) * _standing(papers.station))


def _check_stop(stop: PlannedStop, plan: Plan, station: StationDocument) -> CheckedStop:
    """Gather the passages that are driven for a stop: there, in, and out again."""
    on_the_way = [passage for passage in plan.passages if passage.leg.stop == stop.hole.id]
    nearest = min(on_the_way, key=lambda passage: passage.clearance)
    joints = np.degrees(stop.joints)
    room = [min(angle - low, high - angle)
            for angle, (low, high) in zip(joints, station.limits.joints_deg, strict=True)]
    return CheckedStop(stop, nearest.clearance, nearest.obstacle,
                       min(passage.singularity_deg for passage in on_the_way), float(min(room)),
                       sum(passage.leg.duration(station.robot) for passage in on_the_way))


def _standing(station: StationDocument) -> float:
    """The time at one stop: settling, and two exposures with their lights."""
    camera = station.camera
    return (station.robot.settle_s + 2.0 * station.robot.light_rise_s
            + camera.exposure_ring_s + camera.exposure_laser_s)
