"""Repairing a torn recording: its whole messages into a copy, sealed as repaired.

The original stays as it is, and the copy's seal names it with its hash. Nothing is rewritten: the
copy is the original's own bytes up to the last whole message.
"""

from __future__ import annotations

import os
from pathlib import Path

from cell.core.documents.record import HoleRecord, Start
from cell.core.errors import DocumentError, RecordingError
from cell.recording.framing import copy_whole
from cell.recording.keys import key_path, read_key
from cell.recording.pages import read_pages
from cell.recording.seal import (
    Closed,
    Seal,
    reference,
    seal_path,
    sealed_or_removed,
    write_seal,
)


def repair(log: Path) -> Seal:
    """Write `<log>.repaired.rrd` beside a torn recording and seal it; return the seal.

    Raises:
        DocumentError: it is sealed, so nothing is torn; its content is altered; it holds no whole
            start record; or the copy exists.
        RecordingError: the copy or its seal could not be written.
    """
    if seal_path(log).exists():
        raise DocumentError("has a seal: it was closed properly, there is nothing to repair",
                            source=str(log))
    key = read_key(key_path())
    closed = _what_is_whole(log)
    copy = log.with_name(f"{log.stem}.repaired.rrd")
    with sealed_or_removed(copy):
        _copy(log, copy)
        return write_seal(copy, closed, key)


def _what_is_whole(log: Path) -> Closed:
    """Read to the last whole hole, keeping no images."""
    pages = read_pages(log)
    first = next(pages)
    assert isinstance(first.record, Start)  # `read_pages` sees to it
    chain, holes, faults = first.chain, 0, list(first.faults)
    for page in pages:
        faults += page.faults
        if page.record is not None:
            chain, holes = page.chain, holes + isinstance(page.record, HoleRecord)
    if faults:
        raise DocumentError(f"is altered, not torn: {'; '.join(faults)}", source=str(log))
    return Closed(chain, holes, "repaired", first.record.recording_id, first.record.versions,
                  original=reference(log))


def _copy(log: Path, copy: Path) -> None:
    try:
        with copy.open("xb") as file:
            copy_whole(log, file)
            os.fsync(file.fileno())
    except FileExistsError:
        raise DocumentError("exists already: it was repaired before", source=str(copy)) from None
    except OSError as error:
        raise RecordingError(f"{copy}: cannot be written: {error.strerror}") from error
    copy.chmod(0o444)
