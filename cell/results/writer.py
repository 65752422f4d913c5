"""Writing without waiting: a thread that books what it is handed, in order, until it succeeds.

What it holds when the program is killed is lost here and nowhere else: the recordings have it, and
the next start books them again.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import TypeAlias

from sqlalchemy import Connection

from cell.core.errors import CellError
from cell.results.database import Database, DatabaseError

Write: TypeAlias = Callable[[Connection], None]

RETRY = 2.0
"""Seconds between two tries at a database that does not answer."""


class Writer:
    """Books in the background. `trouble` says what is wrong at the moment, or None."""

    def __init__(self, database: Database, retry: float = RETRY) -> None:
        self.trouble: str | None = None
        self.refused: list[str] = []
        self._database, self._retry = database, retry
        self._writes: queue.SimpleQueue[Write | None] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="results", daemon=True)
        self._thread.start()

    def submit(self, write: Write) -> None:
        """Hand over one write, which becomes one transaction. Never waits."""
        self._writes.put(write)

    def pending(self) -> int:
        """Count the writes that still wait for their turn."""
        return self._writes.qsize()

    def close(self, timeout: float = 30.0) -> bool:
        """Finish what was handed over, for at most `timeout` seconds; tell whether all is written.

        The database is left open. Idempotent.
        """
        if self._thread.is_alive():
            self._writes.put(None)
        self._thread.join(timeout)
        self._stopping.set()
        self._thread.join(self._retry + timeout)
        return not self._thread.is_alive() and self.pending() == 0 and not self.refused

    def _run(self) -> None:
        while (write := self._writes.get()) is not None:
            while not self._written(write):
                if self._stopping.wait(self._retry):
                    self._writes.put(write)
                    return

    def _written(self, write: Write) -> bool:
        """Try once; tell whether the write is done with: written, or refused for good."""
        try:
            with self._database.transaction() as connection:
                write(connection)
        except CellError as error:
            self.trouble = str(error)
            if isinstance(error, DatabaseError) and error.passing:
                return False
            self.refused.append(str(error))
        else:
            self.trouble = None
        return True
