"""The rows of a recording file, whatever state it is in: the one place that reads with rerun."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import LazyChunkStream, RrdReader

from cell.core.errors import CellError, DocumentError, RecordingError
from cell.recording.forms import Plain, plains_of
from cell.recording.framing import copy_whole, read_frame
from cell.recording.layout import is_audited


@dataclass(frozen=True)
class Row:
    """One row of one entity: the `at`-th of those that were written together."""

    path: str
    batch: pa.RecordBatch
    at: int

    def number(self, timeline: str) -> int | None:
        """Return its place on a timeline, None where it has none."""
        column = self._column(timeline)
        return None if column is None else column[self.at].as_py()

    def first(self, name: str) -> Plain:
        """Return the first value of a component, as plain values; None where it is absent."""
        values = self._values(name)
        return plains_of(values[:1])[0] if values else None

    def blob(self, name: str) -> NDArray[np.uint8] | None:
        """Return a component's bytes as a uint8 array that lies where they were read."""
        values = self._values(name)
        return values[0].values.to_numpy() if values else None

    @property
    def name(self) -> str:
        """The last part of the entity's path."""
        return self.path.rpartition("/")[2]

    def _column(self, name: str) -> pa.Array | None:
        index = self.batch.schema.get_field_index(name)
        return None if index < 0 else self.batch.column(index)

    def _values(self, name: str) -> pa.Array | None:
        column = self._column(name)
        return None if column is None else column[self.at].values


def read_rows(path: Path) -> Iterator[Row]:
    """Read the audited rows of a recording in the order in which they were written.

    A file that was cut is read up to its last whole message.

    Raises:
        DocumentError: it cannot be read, is no recording, or its content is damaged.
        RecordingError: it is torn, and there is no room for the copy that it is read from.
    """
    with open_chunks(path) as chunks:
        for chunk in chunks:
            if is_audited(chunk.entity_path):
                batch = chunk.to_record_batch()
                yield from (Row(chunk.entity_path, batch, at) for at in range(batch.num_rows))


@contextmanager
def open_chunks(path: Path) -> Iterator[LazyChunkStream]:
    """Open all that is whole of a recording, picture included.

    Raises:
        DocumentError: it cannot be read, is no recording, or its content is damaged.
        RecordingError: it is torn, and there is no room for the copy that it is read from.
    """
    with _readable(path) as readable, damage_explained(path):
        yield _open(readable, path)


@contextmanager
def _readable(path: Path) -> Iterator[Path]:
    """Give the file itself where it was closed, else a copy of its whole messages."""
    if read_frame(path).closed:
        yield path
        return
    with tempfile.NamedTemporaryFile(suffix=".rrd") as copy:
        try:
            copy_whole(path, copy)
        except OSError as error:
            raise RecordingError(f"{path}: is torn, and cannot be copied to {copy.name} to be "
                                 f"read: {error.strerror}") from None
        yield Path(copy.name)


def _open(readable: Path, path: Path) -> LazyChunkStream:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no index: known, and said by the reader
        reader = RrdReader(readable)
        stores = reader.recordings()
        if len(stores) != 1:
            raise DocumentError(f"holds {len(stores)} recordings; expected one", source=str(path))
        return reader.stream(store=stores[0])


@contextmanager
def damage_explained(path: Path) -> Iterator[None]:
    """Turn whatever a foreign parser raises over damaged content into one sentence."""
    try:
        yield
    except CellError:
        raise
    except Exception as error:
        raise DocumentError(f"is damaged: {error}", source=str(path)) from error
