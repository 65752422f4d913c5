"""`cell report`: the report of a body, made again from its recording."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from cell.core.documents.papers import Papers
from cell.core.errors import DocumentError, RecordingError
from cell.recording import read
from cell.recording.integrity import check_seal
from cell.report.body import BodyRun, body_report


def report_log(log: Path, output: Path | None = None) -> Path:
    """Write the HTML report of a recording, beside it unless told otherwise.

    Raises:
        DocumentError: the recording cannot be read, or is altered.
        RecordingError: the report cannot be written.
    """
    _, checks = check_seal(log)
    recording = read(log)
    if wrong := [*(check.words for check in checks if check.passed is False), *recording.faults]:
        raise DocumentError(f"is not as it was recorded: {'; '.join(wrong)}", source=str(log))
    papers = Papers.parse(recording.start.papers, recording.start.set_id)
    page = body_report(BodyRun(recording.start, recording.holes, recording.stop, papers.holes))
    return write_page(page, output or log.with_suffix(".html"))


def write_page(page: str, path: Path) -> Path:
    """Write a page and return where it is; RecordingError where it cannot be written."""
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        with suppress(OSError):
            path.unlink()  # no part of a report may pass for one
        raise RecordingError(f"the report {path} cannot be written: {error.strerror}") from error
    return path
