"""One body under measurement: it can be broken off, and continued at the hole where it stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeAlias

from cell.core.documents.nominals import Hole
from cell.core.documents.record import HoleRecord, Start, Status, Stop
from cell.core.documents.result import BodyResult
from cell.metrology.judge.decide import judge_run
from cell.programs.inspection.chase import Chase
from cell.programs.inspection.drive import Driver
from cell.programs.inspection.prepare import Prepared
from cell.programs.station import Station
from cell.recording import Recorder

Watch: TypeAlias = Callable[[int, int, str], None]
"""Told how many holes are through, of how many, and what happens now."""


def _every_hole(_hole: Hole) -> bool:
    return True


class BodyInspection:
    """Measures the holes of one body one by one; what is done stays done."""

    def __init__(self, station: Station, prepared: Prepared, start: Start, recorder: Recorder,
                 watch: Watch) -> None:
        self.station, self.prepared, self.start = station, prepared, start
        self.records: list[HoleRecord] = []
        self.stop: Stop | None = None
        self._recorder, self._watch = recorder, watch
        self._driver = Driver(station, prepared)
        self._chase = Chase(station, prepared, self._driver)

    @property
    def result(self) -> BodyResult:
        """The judgement of what has been measured; holes not reached count as not measured."""
        return judge_run(self.prepared.papers, self.start, self.records)

    def measure_remaining(self, wanted: Callable[[Hole], bool] = _every_hole) -> None:
        """Drive home if the arm is elsewhere, then to every hole not yet done, and measure it.

        Args:
            wanted: asked before each stop; a hole that is not wanted stays not measured.

        Raises:
            DeviceError: a device failed; call again after recovery to go on at this hole.
            RecordingError: a record could not be written.
        """
        if not self.records:
            self._driver.go_home()
        for stop in self.prepared.stops[len(self.records):]:
            self._watch(len(self.records), len(self.prepared.stops), f"hole {stop.hole.id}")
            record = self._chase.measure(stop, self.records, skip=not wanted(stop.hole))
            self._recorder.write_hole(record)
            self.records.append(record)
        self._watch(len(self.records), len(self.prepared.stops), "driving home")

    def go_home(self) -> None:
        """Drive back to where the next body may come in."""
        self.station.lights.off()
        self._driver.go_home()

    def finish(self, status: Status, reason: str = "") -> Stop:
        """Judge the body, write the stop record and close the recording.

        Raises:
            RecordingError: it could not be written.
        """
        self.stop = Stop(status, time.time(), len(self.records), reason, self.result)
        self._recorder.finish(self.stop)
        return self.stop

    def abandon(self, status: Status, reason: str) -> Stop:
        """Make the cell safe, then close the recording with what there is."""
        self.station.make_safe()
        return self.finish(status, reason)
