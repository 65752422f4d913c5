"""The cell that a shift runs: a real or simulated station, and the jobs prepared for it."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path

from cell.archive.logs import new_log
from cell.core.documents.nominals import Hole
from cell.core.errors import DocumentError, RecordingError
from cell.programs.approve import approval_hashes
from cell.programs.inspection import BodyInspection, Prepared
from cell.programs.inspection.drive import Driver
from cell.programs.run import begin
from cell.programs.shift.work import Begun, PreparedJob
from cell.programs.station import Station
from cell.recording import Recorder
from cell.recording.room import missing_room
from cell.recording.seal import read_seal, seal_path
from cell.recording.writer import Show


class StationCell:
    """Implements `Cell` over an open station."""

    def __init__(self, station: Station, prepared: Mapping[str, Prepared], logs: Path,
                 live: Show | None = None) -> None:
        self.name = station.document.name
        self.jobs = {file: prepare_job(one) for file, one in prepared.items()}
        self._prepared = {one.papers.job.name: one for one in prepared.values()}
        self._station, self._logs, self._live = station, logs, live

    def begin(self, job: PreparedJob, body_id: str, *, trial: bool) -> Begun:
        """Open the recording of a body.

        Raises:
            DocumentError: the logs folder cannot be used.
            RecordingError: the disk is full or fails.
        """
        self._check_room()
        prepared, log = self._prepared[job.name], new_log(self._logs, job.name)
        start = begin(prepared, self._station, body_id, log.stem, trial=trial)
        recorder = Recorder(log, start, self._live)
        inspection = BodyInspection(self._station, prepared, start, recorder, _unwatched)
        return Begun(start, inspection, lambda: _chain_of(log))

    def go_home(self) -> None:
        """Drive home, as the first stop of any job would begin."""
        Driver(self._station, next(iter(self._prepared.values()))).go_home()

    def make_safe(self) -> None:
        """Lights off, arm at rest."""
        self._station.make_safe()

    def recover(self) -> None:
        """Reach robot and camera again after a person has removed a cause."""
        self._station.robot.recover()
        self._station.lights.off()
        self._station.camera.open()

    def _check_room(self) -> None:
        if missing := missing_room(self._logs):
            full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            raise RecordingError(f"{self._logs}: {missing}") from full


def prepare_job(prepared: Prepared) -> PreparedJob:
    """Say of a prepared job what a shift needs to know."""
    papers = prepared.papers
    holes: tuple[Hole, ...] = tuple(stop.hole for stop in prepared.stops)
    return PreparedJob(papers.job.name, holes, frozenset(papers.job.alignment.datums),
                       approval_hashes(papers.texts))


def _chain_of(log: Path) -> str:
    """Read the head of a recording's chain from its seal; empty where it could not be sealed."""
    try:
        return read_seal(seal_path(log)).chain
    except DocumentError:
        return ""


def _unwatched(_done: int, _count: int, _words: str) -> None:
    """Watch nothing: the shift has its own board."""
