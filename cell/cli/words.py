"""How the door speaks: tables and progress on standard error, JSON on standard output."""

from __future__ import annotations

import getpass
import json
import os
import shutil
import sys
from contextlib import suppress
from typing import Any

import numpy as np
from rich.console import Console

from cell.core.errors import RecordingError

NARROWEST = 80  # columns; a narrower terminal breaks the lines of a table, and no number is lost


class Answers(Console):
    """Standard output, for the tables that are the answer of a command without `--json`.

    A reader who has gone (`| head -1`) changes nothing of the command's exit code.
    """

    def print(self, *objects: Any, **how: Any) -> None:  # noqa: ANN401  as rich has it
        """Print; RecordingError where it cannot be written, as on a full disk."""
        try:
            super().print(*objects, **how)
        except OSError as error:
            raise _unwritten(error) from None

    def on_broken_pipe(self) -> None:
        """Say no more."""
        self.quiet = True
        forget_output()


console = Console(stderr=True)
"""For people: progress, and what went wrong."""

answers = Answers(width=max(NARROWEST, shutil.get_terminal_size().columns))


def user_name() -> str:
    """Return who is logged in; `unknown` for a user id without an account, as in a container."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # Python until 3.12, from 3.13
        return "unknown"


def print_json(answer: dict[str, Any]) -> None:
    """Print the one object of a `--json` command; RecordingError where it cannot be written."""
    try:
        sys.stdout.write(json.dumps(answer, default=_plain, allow_nan=False) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        forget_output()
    except OSError as error:
        raise _unwritten(error) from None


def forget_output() -> None:
    """Lead standard output to nowhere: nobody reads it."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _unwritten(error: OSError) -> RecordingError:
    forget_output()  # or the interpreter tries again on its way out
    return RecordingError(f"the answer cannot be written to standard output: {error.strerror}")


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no JSON form")
