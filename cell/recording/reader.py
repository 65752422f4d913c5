"""Reading a recording back as a whole: exactly what was written, to the last whole hole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.errors import DocumentError
from cell.recording.pages import read_pages


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording with all its images in memory.

    `head` is the last link of its chain; `faults` are sentences on what is not as it was written,
    `losses` on what a torn end cost, `missing` counts images that are not there.
    """

    path: Path
    start: Start
    holes: list[HoleRecord]
    stop: Stop | None
    head: str
    faults: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    missing: int = 0

    @property
    def status(self) -> str:
        """How the run ended; one without a stop record died."""
        return "died" if self.stop is None else self.stop.status


def read(path: Path) -> Recording:
    """Read a recording, be it closed, torn or altered: what is wrong is in its `faults`.

    Raises:
        DocumentError: not a recording, damaged, without a whole start, or of a newer format.
    """
    pages = list(read_pages(path))
    records = [page.record for page in pages]
    start, stop = records[0], records[-1]
    if not isinstance(start, Start):
        raise DocumentError("does not begin with a start record", source=str(path))
    return Recording(
        path, start,
        [record for record in records if isinstance(record, HoleRecord)],
        stop if isinstance(stop, Stop) else None,
        [page.chain for page in pages if page.record is not None][-1],
        tuple(fault for page in pages for fault in page.faults),
        tuple("the last hole is not whole and is left out" for page in pages
              if page.record is None and not page.faults),
        sum(page.missing for page in pages if page.record is not None),
    )
