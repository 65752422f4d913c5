"""How the door speaks: tables and progress on standard error, JSON on standard output."""

from __future__ import annotations

import getpass
import json
import shutil
import sys
from typing import Any

import numpy as np
from rich.console import Console

NARROWEST = 80  # columns; a narrower terminal breaks the lines of a table, and no number is lost


console = Console(stderr=True)
"""For people: progress, and what went wrong."""

answers = Console(width=max(NARROWEST, shutil.get_terminal_size().columns))
"""Standard output, for the tables that are the answer of a command without `--json`."""


def user_name() -> str:
    """Return who is logged in; `unknown` for a user id without an account, as in a container."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # Python until 3.12, from 3.13
        return "unknown"


def print_json(answer: dict[str, Any]) -> None:
    """Print the one object of a `--json` command; RecordingError where it cannot be written."""
    sys.stdout.write(json.dumps(answer, default=_plain, allow_nan=False) + "\n")
    sys.stdout.flush()


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no JSON form")
