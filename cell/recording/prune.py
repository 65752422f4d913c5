"""Pruning: a copy without images, years later. The chain still holds, one level weaker.

Every number, every paper and the hash of every image stay; the pixels cannot be measured again.
"""

from __future__ import annotations

from pathlib import Path

from cell.core.errors import DocumentError, RecordingError
from cell.recording import layout
from cell.recording.integrity import check_seal
from cell.recording.keys import key_path, read_key
from cell.recording.rows import open_chunks
from cell.recording.seal import Closed, Seal, reference, sealed_or_removed, write_seal


def prune(log: Path) -> Seal:
    """Write `<log>.pruned.rrd` beside a sealed recording, without its images, and seal it.

    Raises:
        DocumentError: the recording is not as it was sealed, or the copy exists.
        RecordingError: the copy or its seal could not be written.
    """
    seal, checks = check_seal(log)
    if seal is None or any(check.passed is False for check in checks):
        raise DocumentError("is not as it was sealed: only an intact recording is pruned",
                            source=str(log))
    copy = log.with_name(f"{log.stem}.pruned.rrd")
    if copy.exists():
        raise DocumentError("exists already: it was pruned before", source=str(copy))
    key = read_key(key_path())
    closed = Closed(seal.chain, seal.holes, "pruned", seal.recording_id, seal.versions,
                    original=reference(log))
    with sealed_or_removed(copy):
        _copy_without_images(log, copy, seal.recording_id)
        return write_seal(copy, closed, key)


def _copy_without_images(log: Path, copy: Path, recording_id: str) -> None:
    with open_chunks(log) as chunks:
        kept = chunks.drop(content=list(layout.IMAGES))
        try:
            kept.write_rrd(copy, application_id=layout.APPLICATION, recording_id=recording_id)
        except (OSError, RuntimeError) as error:
            raise RecordingError(f"{copy}: cannot be written: {error}") from error
    copy.chmod(0o444)
