"""Reading what may be damaged in a process of its own: a changed length can make the foreign parser
abort, and that must be a sentence, not the end of the program.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from cell.core.errors import DocumentError

Answer = TypeVar("Answer")


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """Give `count` processes on this machine."""
    with ProcessPoolExecutor(count, multiprocessing.get_context("spawn")) as executor:
        yield executor


def guarded(read: Callable[[Path], Answer], log: Path) -> Answer:
    """Read a recording in a process of its own.

    Raises:
        DocumentError: what `read` raises, or that the content takes the process down.
    """
    with processes(1) as executor:
        try:
            return executor.submit(read, log.resolve()).result()
        except BrokenProcessPool:
            raise DocumentError("is damaged: its content takes the reader down",
                                source=str(log)) from None
