"""`cell study offsets`: from recordings of the master body to the offsets of a job."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cell.archive.files import replace_text
from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.documents.text import dump
from cell.core.errors import DocumentError
from cell.metrology.study.offsets import (
    FEWEST_RUNS,
    MasterRun,
    OffsetsStudy,
    judge_master_run,
    learn_offsets,
)
from cell.recording.integrity import check_chain, check_seal
from cell.recording.pages import Page, read_pages, without_images
from cell.recording.seal import Closed, Seal


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording of the master body that may be learnt from."""

    log: Path
    start: Start
    papers: Papers
    run: MasterRun


@dataclass(frozen=True, eq=False)
class LearntOffsets:
    """What was learnt, and from what."""

    recordings: tuple[Recorded, ...]
    study: OffsetsStudy
    expires: str

    @property
    def place(self) -> Path:
        """Where a cell looks for the offsets of this job."""
        papers = self.recordings[0].papers
        return Path("calibration", papers.station.name, "offsets", f"{papers.job.name}.yaml")


def study_offsets(logs: Sequence[Path], days: int, by: str = "") -> LearntOffsets:
    """Learn CMM offsets from recordings of one master body.

    Args:
        logs: recordings of whole runs with one job and one calibration.
        days: for how many days after the last run they hold.
        by: who learns them.

    Raises:
        DocumentError: too few recordings, or one that is unsealed, altered or incomplete, or does
            not belong to the others.
    """
    if len(logs) < FEWEST_RUNS:
        raise DocumentError(f"{len(logs)} recordings: an offset is learnt from at least "
                            f"{FEWEST_RUNS} runs over the master body", place="LOG")
    recordings = tuple(_read(log) for log in logs)
    _check_they_belong_together(recordings)
    last = np.datetime64(max(recorded.run.day for recorded in recordings))
    expires = str(last + np.timedelta64(days, "D"))
    study = learn_offsets([recorded.run for recorded in recordings],
                          recordings[0].papers.planned_holes, expires, by)
    if not study.learnt:
        raise DocumentError("no hole can be learnt: " + "; ".join(
            f"{hole}: {reason}" for hole, reason in study.left_out.items()))
    return LearntOffsets(recordings, study, expires)


def write_offsets(study: OffsetsStudy, out: Path, *, anew: bool = False) -> None:
    """Write the document of a study.

    Raises:
        DocumentError: the file exists and is not to be made `anew`, or cannot be written.
    """
    if out.exists() and not anew:
        raise DocumentError("exists already: keep it elsewhere, or give --replace",
                            source=str(out), place="--out")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DocumentError(f"cannot be made: {error.strerror}", source=str(out.parent)) from None
    replace_text(out, dump(study.document))


def _read(log: Path) -> Recorded:
    """Read a sealed recording of a whole run, without its images."""
    seal = _check_seal(log)
    pages = [_without_images(page) for page in read_pages(log)]
    start, stop = pages[0].record, pages[-1].record
    records = [page.record for page in pages if isinstance(page.record, HoleRecord)]
    status = stop.status if isinstance(stop, Stop) else "died"
    assert isinstance(start, Start)  # `read_pages` sees to it
    chain = check_chain(seal, Closed(pages[-1].chain, len(records), status, start.recording_id),
                        [fault for page in pages for fault in page.faults])
    if not chain.passed:
        raise DocumentError(f"not as it was recorded: {chain.words}", source=str(log))
    if status != "complete":
        raise DocumentError(f"expected a complete run; this one ended: {status}", source=str(log))
    papers = Papers.parse(start.papers, start.set_id)
    return Recorded(log, start, papers, judge_master_run(papers, start, records))


def _check_seal(log: Path) -> Seal:
    """What every later body is corrected by is learnt from sealed recordings alone."""
    if not log.is_file():
        raise DocumentError("there is no such recording", source=str(log))
    seal, checks = check_seal(log)
    failed = [check.words for check in checks if check.passed is False or seal is None]
    if seal is None or failed:
        raise DocumentError(f"not as it was sealed: {'; '.join(failed)}", source=str(log))
    return seal


def _without_images(page: Page) -> Page:
    record = page.record
    return replace(page, record=without_images(record)) if isinstance(record, HoleRecord) else page


def _check_they_belong_together(recordings: Sequence[Recorded]) -> None:
    """Refuse to mix bodies, jobs, cells or calibrations, or to count one run twice."""
    first = recordings[0]
    for other in recordings[1:]:
        for what, one, another in _belongings(first, other):
            if one != another:
                raise DocumentError(f"is of {what} {another}; {first.log} is of {what} {one}: "
                                    "offsets are learnt on one master body, with one job and one "
                                    "calibration", source=str(other.log))
        _check_papers(first, other)
    counts = Counter(recorded.start.recording_id for recorded in recordings)
    for recorded in recordings:
        if counts[recorded.start.recording_id] > 1:
            raise DocumentError("the same run stands twice among the recordings",
                                source=str(recorded.log))


def _belongings(first: Recorded, other: Recorded) -> list[tuple[str, str, str]]:
    return [("the job", first.papers.job.name, other.papers.job.name),
            ("the cell", first.papers.station.name, other.papers.station.name),
            ("the calibration set", first.start.set_id, other.start.set_id),
            ("the body", first.start.body_id, other.start.body_id)]


def _check_papers(first: Recorded, other: Recorded) -> None:
    """The same names are not enough: the texts must be the same, but for the offsets themselves."""
    names = sorted((first.start.papers.keys() | other.start.papers.keys()) - {"offsets"})
    changed = [name for name in names
               if first.start.papers.get(name) != other.start.papers.get(name)]
    if changed:
        raise DocumentError(f"was run with another {', '.join(changed)} than {first.log}: measure "
                            "the master again with the papers of today", source=str(other.log))
