"""What stands before a run: documents read, the way planned and checked, nothing moved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cell.archive.papers import PapersFound, read_papers
from cell.core.documents.papers import Papers, check_identity
from cell.core.kinematics import Arm, arm_for
from cell.core.ports import RobotIdentity
from cell.metrology.plan import PlannedStop, plan_stops


@dataclass(frozen=True, eq=False)
class Prepared:
    """A job ready to run: what its papers say, and the stops in order.

    `folder` is the cell's own.
    """

    papers: Papers
    folder: Path
    arm: Arm
    stops: tuple[PlannedStop, ...]

    def check_identity(self, identity: RobotIdentity) -> None:
        """Refuse a robot other than the one that the calibration set was made with."""
        check_identity(self.papers.calibration.hand_eye.robot, identity,
                       self.papers.sources["hand_eye"])


def prepare(job: Path, cell: str | None = None) -> Prepared:
    """Read the documents of a job and plan its stops.

    Raises:
        DocumentError: a document is wrong, or a stop cannot be reached safely.
    """
    return prepare_papers(read_papers(job, cell))


def prepare_papers(found: PapersFound) -> Prepared:
    """Parse the papers of a job and plan its stops; errors as in `prepare`."""
    papers = found.parse()
    arm = arm_for(papers.station.robot.model)
    stops = plan_stops(papers.job, papers.holes, papers.calibration, papers.station, arm)
    return Prepared(papers, found.folder, arm, stops)
