"""The books of a shift: the cell's own database, and beside it a plant's where there is one."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import TracebackType

from cell.programs.results import book_missing
from cell.results.database import Database, connect, prepare
from cell.results.ledger import Mirror
from cell.results.writer import Write, Writer


class Books:
    """Hands every write to each database's own writer. A plant that is away delays nobody."""

    def __init__(self, own: Database, plant: str | None, logs: Path) -> None:
        """Begin to write; `plant` is a database's URL."""
        self._away = None if plant is None else connect(plant)  # may refuse: before any thread
        self._own, self._plant = Writer(own), None
        if self._away is not None:
            self._plant = Writer(self._away)
            self._plant.submit(partial(prepare, source=str(self._away)))
            self._plant.submit(partial(book_missing, logs=logs))

    @property
    def mirror(self) -> Mirror | None:
        """Where the ledger repeats its entries."""
        return self._plant.submit if self._plant else None

    @property
    def trouble(self) -> str:
        """What is wrong with a database at the moment, or nothing."""
        return "; ".join(writer.trouble for writer in self._writers if writer.trouble)

    def submit(self, write: Write) -> None:
        """Hand a write to every database."""
        for writer in self._writers:
            writer.submit(write)

    def settle(self, timeout: float = 30.0) -> bool:
        """Wait for what is not yet written; tell whether all of it is."""
        settled = [writer.close(timeout) for writer in self._writers]
        return all(settled)

    def __enter__(self) -> Books:
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: BaseException | None,
                 _trace: TracebackType | None) -> None:
        self.settle()
        if self._away is not None:
            self._away.close()

    @property
    def _writers(self) -> list[Writer]:
        return [self._own, *([self._plant] if self._plant else [])]
