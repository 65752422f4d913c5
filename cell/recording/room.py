"""Whether a body can be recorded at all: known before the cell is opened and before each body."""

from __future__ import annotations

import shutil
from pathlib import Path

from cell.core.errors import DocumentError
from cell.recording.keys import key_path, read_key

ROOM = 200e6
"""Bytes that must be free before a body: some 300 holes."""


def missing_room(folder: Path) -> str | None:
    """Say how little room the disk of a folder has, None where it has enough for a body."""
    free = shutil.disk_usage(folder).free
    if free >= ROOM:
        return None
    return (f"{free / 1e6:.0f} MB are free on its disk; {ROOM / 1e6:.0f} MB are needed before a "
            "body is begun")


def check_recordable(folder: Path) -> None:
    """Check what a recorder would refuse only once the cell is open.

    Args:
        folder: an existing folder for recordings.

    Raises:
        DocumentError: its disk is too full for a body, or others can read the key for seals.
    """
    if missing := missing_room(folder):
        raise DocumentError(missing, source=str(folder))
    read_key(key_path())
