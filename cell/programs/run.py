"""`cell run`: one body from a job file to a verdict, a recording, a seal and a report."""

from __future__ import annotations

import json
import re
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cell.archive.logs import new_log
from cell.core.documents.record import Start
from cell.core.documents.result import BodyResult
from cell.core.errors import CellError, DocumentError, RecordingError
from cell.programs.inspection import BodyInspection, Prepared, Watch, prepare
from cell.programs.report import write_page
from cell.programs.station import Station, open_station
from cell.recording import Recorder, collect_versions
from cell.recording.live import LiveView
from cell.recording.room import check_recordable
from cell.report.body import BodyRun, body_report

BODY_ID = re.compile(r"[^\x00-\x1f\x7f-\x9f\u2028\u2029]{1,100}")


@dataclass(frozen=True)
class Request:
    """What `cell run` was asked for."""

    job: Path
    cell: str | None = None
    body_id: str | None = None
    logs: Path = Path("logs")
    speed: float = 1.0
    truth: Path | None = None
    part_temperature_c: float | None = None
    live: bool = False

    @property
    def conditions(self) -> dict[str, float]:
        """The numbers of the day that enter the judgement."""
        known = {"part_temperature_c": self.part_temperature_c}
        return {name: value for name, value in known.items() if value is not None}


@dataclass(frozen=True, eq=False)
class Finished:
    """What came of it."""

    body_id: str
    status: Literal["complete", "interrupted"]
    result: BodyResult
    log: Path
    report: Path


def run_job(request: Request, watch: Watch) -> Finished:
    """Measure one body as the job says.

    Everything that can be known before the robot moves is checked first.

    Raises:
        DocumentError: job, nominals, calibration, logs folder or an option is wrong; nothing moved.
        DeviceError: a device failed; what was seen until then is in the recording.
        RecordingError: the recording could not be written.
    """
    prepared = prepare(request.job, request.cell)
    _check_options(request, prepared)
    log = new_log(request.logs, prepared.papers.job.name)
    check_recordable(request.logs)
    body_id = request.body_id or f"{prepared.papers.job.name}-{secrets.token_hex(4)}"
    watch(0, len(prepared.stops), "opening the cell")
    with (open_station(prepared.papers.station, prepared.folder, request.speed) as station,
          LiveView() if request.live else nullcontext() as live):
        prepared.check_devices(station)
        start = begin(prepared, station, body_id, log.stem, conditions=request.conditions)
        inspection = BodyInspection(station, prepared, start, Recorder(log, start, live), watch)
        with _told(log, inspection):
            status = measure(inspection)
        truth = station.world.truth() if station.world is not None else {}
    report = write_report(log, start, inspection)
    if request.truth is not None:
        _write_truth(request.truth, {"body": body_id, **truth})
    return Finished(body_id, status, inspection.result, log, report)


def begin(prepared: Prepared, station: Station, body_id: str, recording_id: str, *,
          conditions: Mapping[str, float] | None = None, trial: bool = True) -> Start:
    """Write down everything that is known before the first move.

    Args:
        prepared: the job.
        station: the open cell.
        body_id: the body's number; it stands in the recording, never in a file's name.
        recording_id: the recording's own.
        conditions: numbers of the day that enter the judgement, such as `part_temperature_c`.
        trial: whether job or calibration lack the approval for production.
    """
    return Start(recording_id, body_id, time.time(), prepared.papers.set_id, prepared.papers.texts,
                 collect_versions(), station.identity.as_text(), dict(conditions or {}),
                 trial=trial, simulated=station.document.simulated)


@contextmanager
def _told(log: Path, inspection: BodyInspection) -> Iterator[None]:
    """Have a run that failed leave its report too, and its error say where they lie."""
    try:
        yield
    except CellError as error:
        error.add_note(f"recording {log}")
        if inspection.stop is not None:
            with suppress(CellError):  # the first error counts
                error.add_note(f"report    {write_report(log, inspection.start, inspection)}")
        raise


def write_report(log: Path, start: Start, inspection: BodyInspection) -> Path:
    """Write the HTML report beside the recording and return where it is."""
    page = body_report(BodyRun(start, inspection.records, inspection.stop,
                               inspection.prepared.papers.holes))
    return write_page(page, log.with_suffix(".html"))


def measure(inspection: BodyInspection) -> Literal["complete", "interrupted"]:
    """Measure all holes and close the recording, whatever happens on the way."""
    try:
        inspection.measure_remaining()
        inspection.go_home()
    except KeyboardInterrupt:
        inspection.abandon("interrupted", "stopped by a person")
        return "interrupted"
    except CellError as error:
        inspection.abandon("fault", str(error))
        raise
    except BaseException as error:
        inspection.abandon("aborted", f"a fault of the program: {error!r}")
        raise
    inspection.finish("complete")
    return "complete"


def _check_options(request: Request, prepared: Prepared) -> None:
    station = prepared.papers.station
    if request.truth is not None and station.camera.driver != "sim":
        raise DocumentError("--truth is for simulated cells: nobody knows the truth of a real body",
                            source=f"cell {station.name}")
    if request.speed != 1.0 and not station.simulated:
        raise DocumentError("--speed is for simulated cells: a real robot runs in real time",
                            source=f"cell {station.name}")
    if request.truth is not None:
        _check_truth(request.truth)
    if request.body_id is not None and not BODY_ID.fullmatch(request.body_id):
        raise DocumentError("expected 1 to 100 printable characters for the body's number; came "
                            f"{request.body_id!r}", place="--body")


def _check_truth(path: Path) -> None:
    """Refuse, before anything moves, a file that could not be written after the run."""
    there = path.exists()
    try:
        path.open("a").close()
    except OSError as error:
        raise DocumentError(f"the truth cannot be written here: {error.strerror}",
                            source=str(path)) from None
    if not there:
        path.unlink()


def _write_truth(path: Path, truth: Mapping[str, object]) -> None:
    try:
        path.write_text(json.dumps(truth, indent=1))
    except OSError as error:
        raise RecordingError(f"the truth cannot be written to {path}: {error.strerror}") from error
