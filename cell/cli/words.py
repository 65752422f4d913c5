"""How the door speaks: tables and progress on standard error, JSON on standard output."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from rich.console import Console

console = Console(stderr=True)
"""For people. Tables that are the answer of a command without `--json` go to `answers`."""

answers = Console()


def print_json(answer: dict[str, Any]) -> None:
    """Print the one object of a `--json` command."""
    sys.stdout.write(json.dumps(answer, default=_plain, allow_nan=False) + "\n")
    sys.stdout.flush()


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no JSON form")
