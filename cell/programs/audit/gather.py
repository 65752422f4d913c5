"""What `cell audit` works on: the recordings that paths name, and the documents of a what-if."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import get_args

from cell.archive.files import read_text
from cell.archive.sets import CALIBRATION, read_set
from cell.core.documents.job import JobDocument
from cell.core.documents.record import Start
from cell.core.documents.text import parse
from cell.core.errors import CellError, DocumentError
from cell.metrology.locate.pair import Method
from cell.programs.audit.folder import FolderAudit, audit_folder
from cell.programs.audit.question import WhatIf
from cell.recording.pages import read_pages

METHODS = get_args(Method)
DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")


def gather_logs(paths: Sequence[Path]) -> tuple[list[Path], list[FolderAudit]]:
    """Resolve files and folders to recordings; a folder's are audited as a row as well.

    Raises:
        DocumentError: a path does not exist, or there is no recording in them.
    """
    logs: list[Path] = []
    folders: list[FolderAudit] = []
    for path in paths:
        if path.is_dir():
            folders.append(audit_folder(path))
            unsealed = [path / f.file for f in folders[-1].findings if f.kind == "unsealed"]
            logs += [*folders[-1].logs, *unsealed]
        elif path.exists():
            logs.append(path)
        else:
            raise DocumentError("there is no such recording or folder", source=str(path))
    if not logs:
        raise DocumentError("no recordings here", source=", ".join(map(str, paths)))
    return list(dict.fromkeys(logs)), folders


def started_since(logs: Sequence[Path], moment: datetime) -> list[Path]:
    """Keep the recordings begun at or after a moment, and those that cannot tell.

    Raises:
        DocumentError: there is none: an audit of nothing would read as if all was well.
    """
    began = {log: _started(log) for log in logs}
    kept = [log for log, at in began.items() if at is None or at >= moment.timestamp()]
    if not kept:
        last = datetime.fromtimestamp(max(at for at in began.values() if at is not None),
                                      moment.tzinfo)
        raise DocumentError(f"none of {len(logs)} recordings began since {moment:%Y-%m-%d %H:%M}; "
                            f"the last one began {last:%Y-%m-%d %H:%M}", place="--since")
    return kept


def parse_since(words: str, now: datetime) -> datetime:
    """Parse a day, `2026-11-16`, a moment, `2026-11-16T06:00`, or the last `monday`.

    Raises:
        DocumentError: it is neither.
    """
    if words.lower() in DAYS:
        back = (now.weekday() - DAYS.index(words.lower())) % 7
        return (now - timedelta(days=back)).replace(hour=0, minute=0, second=0, microsecond=0)
    try:
        moment = datetime.fromisoformat(words)
    except ValueError:
        raise DocumentError(f"expected a day as 2026-11-16 or monday; came {words!r}",
                            place="--since") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=now.tzinfo or UTC)


def read_what_if(calibration: str | None, job: Path | None, method: str | None) -> WhatIf:
    """Read the documents to measure or to judge with instead of the recorded ones.

    Args:
        calibration: the folder of a calibration set, or its id under `calibration/`.
        job: a job; its nominals lie beside it.
        method: `joint` or `two-step`.

    Raises:
        DocumentError: one of them is missing, ambiguous or wrong.
    """
    if method not in (None, *METHODS):
        raise DocumentError(f"expected {' or '.join(METHODS)}; came {method!r}", place="--method")
    texts: dict[str, str] = {}
    if calibration is not None:
        folder = _set_folder(calibration)
        texts |= read_set(folder.parent.parent, folder.name).texts
    if job is not None:
        texts["job"] = read_text(job)
        document = parse(JobDocument, texts["job"], str(job))
        texts["nominals"] = read_text(job.parent / document.nominals)
    return WhatIf(texts, method)


def _set_folder(name: str) -> Path:
    if Path(name).is_dir():
        return Path(name).resolve()
    found = sorted(CALIBRATION.glob(f"*/sets/{name}"))
    if len(found) != 1:
        raise DocumentError(f"expected the folder of a calibration set, or the id of one; "
                            f"{len(found)} sets are called {name!r}", place="--calibration")
    return found[0].resolve()


def _started(log: Path) -> float | None:
    try:
        first = next(read_pages(log)).record
    except CellError:
        return None
    return first.started if isinstance(first, Start) else None
