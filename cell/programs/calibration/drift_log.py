"""`drift/log.jsonl`: every check of a cell, one synced line each, and what was corrected when."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cell.archive.files import append_line, read_json_lines

LOG = "drift/log.jsonl"
REGISTERED, CORRECTED = "registered", "corrected"


def read_past(folder: Path, set_id: str) -> list[dict[str, Any]]:
    """Read the checks of a set that still count, oldest first: the first is the reference.

    A correction makes what was measured with it the reference; a registration starts anew. A last
    line that was cut short does not count.

    Raises:
        DocumentError: the log cannot be read.
    """
    past: list[dict[str, Any]] = []
    for line in map(json.loads, read_json_lines(folder / LOG)):
        if line["set"] != set_id:
            continue
        if line["alarm"] in (REGISTERED, CORRECTED):
            past = []
        if line["alarm"] != REGISTERED:
            past.append(line)
    return past


def append_check(folder: Path, set_id: str, content: dict[str, Any]) -> None:
    """Add a line; on return it is on the disk.

    Raises:
        DocumentError: the disk refuses.
    """
    at = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    append_line(folder / LOG, json.dumps({"at": at, "set": set_id, **content}))
