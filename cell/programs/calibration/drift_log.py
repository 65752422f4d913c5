"""`drift/log.jsonl`: every check of a cell, one synced line each, and what was corrected when."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cell.archive.files import read_text
from cell.core.errors import DocumentError

LOG = "drift/log.jsonl"
REGISTERED, CORRECTED = "registered", "corrected"


def read_past(folder: Path, set_id: str) -> list[dict[str, Any]]:
    """Read the checks of a set that still count, oldest first: the first is the reference.

    A correction makes what was measured with it the reference; a registration starts anew. A last
    line that was cut short does not count.

    Raises:
        DocumentError: the log cannot be read.
    """
    file = folder / LOG
    lines = read_text(file).splitlines() if file.exists() else []
    past: list[dict[str, Any]] = []
    for line in (json.loads(text) for text in lines if _is_whole(text)):
        if line["set"] != set_id:
            continue
        if line["alarm"] in (REGISTERED, CORRECTED):
            past = []
        if line["alarm"] != REGISTERED:
            past.append(line)
    return past


def append_line(folder: Path, set_id: str, content: dict[str, Any]) -> None:
    """Add a line; on return it is on the disk.

    Raises:
        DocumentError: the disk refuses.
    """
    file = folder / LOG
    at = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    try:
        file.parent.mkdir(exist_ok=True)
        known = file.read_bytes() if file.exists() else b""
        cut = b"\n" if known and not known.endswith(b"\n") else b""
        with file.open("ab") as stream:
            stream.write(cut + json.dumps({"at": at, "set": set_id, **content}).encode() + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(file)) from None


def _is_whole(text: str) -> bool:
    return text.startswith("{") and text.endswith("}")
