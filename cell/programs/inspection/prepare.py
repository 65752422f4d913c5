"""What stands before a run: documents read, the way planned and checked, nothing moved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cell.archive.papers import PapersFound, read_papers
from cell.core.documents.papers import Papers, check_identity
from cell.core.errors import DeviceError
from cell.core.kinematics import Arm, arm_for
from cell.metrology.plan.stops import PlannedStop, plan_stops
from cell.programs.station import Station


@dataclass(frozen=True, eq=False)
class Prepared:
    """A job ready to run: what its papers say, and the stops in order.

    `folder` is the cell's own.
    """

    papers: Papers
    folder: Path
    arm: Arm
    stops: tuple[PlannedStop, ...]

    def check_devices(self, station: Station) -> None:
        """Compare robot and camera with the calibration set.

        Raises:
            DocumentError: the set was made with another robot, TCP or payload.
            DeviceError: the camera's images have another size than the set's.
        """
        check_identity(self.papers.calibration.hand_eye.robot, station.identity,
                       self.papers.sources["hand_eye"])
        wanted = self.papers.calibration.sensor.image_size
        if station.image_size != wanted:
            raise DeviceError("its images have {} x {} px; ".format(*station.image_size)
                              + "the active set was made with {} x {} px".format(*wanted),
                              device="camera")


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
