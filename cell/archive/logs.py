"""The folder of recordings: checked before anything moves, names that say nothing of the body."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from pathlib import Path

from cell.archive.files import check_writable
from cell.core.errors import DocumentError

PICTURE = ".audit.rrd"  # what an audit drew beside a recording


def new_log(folder: Path, job: str) -> Path:
    """Name a new recording, `<job>_<time>_<random>.rrd`, in a folder that can take it.

    Raises:
        DocumentError: the folder cannot be made or written, is full, or the name exists.
    """
    check_logs(folder)
    moment = datetime.now(UTC).strftime("%Y-%m-%dT%H%M%SZ")
    log = folder / f"{job}_{moment}_{secrets.token_hex(4)}.rrd"
    if log.exists():
        raise DocumentError("a recording of that name exists; none is ever overwritten",
                            source=str(log))
    return log


def check_logs(folder: Path) -> None:
    """Make the folder where it is absent, and try that a megabyte can be written there.

    Raises:
        DocumentError: it is a file, cannot be made or written, or is full.
    """
    check_writable(folder, "recordings")


def choose_log(log: Path) -> Path:
    """Take a recording as it is; of a folder, its newest recording.

    Raises:
        DocumentError: the folder holds none.
    """
    if not log.is_dir():
        return log
    found = sorted((one for one in log.glob("*.rrd")
                    if one.is_file() and not one.name.endswith(PICTURE)),
                   key=lambda one: one.stat().st_mtime)
    if not found:
        raise DocumentError("there is no recording (.rrd) in this folder", source=str(log))
    return found[-1]
