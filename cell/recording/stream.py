"""A recording file as rerun writes it: rows out, and nothing counts before it is on the disk."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import pyarrow as pa
import rerun as rr

from cell.core.errors import RecordingError
from cell.core.observation import Image
from cell.recording import layout
from cell.recording.disk import Disk
from cell.recording.memory import sweep_streams

PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1,
       cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
"""Lossless: noise has no repetitions to look for but runs of black and white, so that this is
smaller and twice as fast. Reading it back is bound by inflating, whatever it was written with.
"""
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # OpenCV 4.11 and newer
    PNG += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]


def encode(image: Image) -> rr.EncodedImage:
    """Encode an image without loss."""
    done, png = cv2.imencode(".png", image, PNG)
    if not done:
        raise RecordingError("an image cannot be encoded")
    return rr.EncodedImage(contents=png.tobytes(), media_type="image/png")


class Stream:
    """One recording file. Strict: what rerun cannot take is an error, not a warning."""

    def __init__(self, path: Path, recording_id: str) -> None:
        """Create the file, which must not exist.

        Raises:
            OSError: it exists, or cannot be created.
        """
        rr.set_strict_mode(True)
        sweep_streams()
        self.path, self._disk = path, Disk(path)
        self.rerun = rr.RecordingStream(layout.APPLICATION, recording_id=recording_id)
        self.rerun.set_sinks(rr.FileSink(self._disk.entrance))
        self._disk.opened()

    def at(self, timeline: str, sequence: int) -> None:
        """Set the place on a timeline for what this thread writes next."""
        self.rerun.set_time(timeline, sequence=sequence)

    def write_record(self, place: layout.Place, record: pa.Array, chain: str) -> None:
        """Write one record as a typed column, with its link of the chain."""
        row = rr.DynamicArchetype(place.archetype,
                                  components={"record": record, "chain": chain})
        self.rerun.log(place.path, row, static=place.static)

    def write_text(self, path: str, text: str, media_type: str = "text/plain") -> None:
        """Write a text, to the character, outside of time."""
        self.rerun.log(path, rr.TextDocument(text, media_type=media_type), static=True)

    def write_image(self, path: str, image: Image, pixel_hash: str) -> None:
        """Write an image without loss, beside the hash of its pixels."""
        self.rerun.log(path, encode(image), rr.DynamicArchetype(layout.IMAGE_ARCHETYPE,
                                           components={"sha256": pixel_hash}))

    def flush(self) -> None:
        """Bring everything written so far to the disk itself.

        Raises:
            RecordingError: the disk is full or gone.
        """
        self.rerun.flush()
        with self._telling():
            self._disk.sync()

    def close(self) -> None:
        """End the file with its index.

        Raises:
            RecordingError: the disk is full or gone.
        """
        self.rerun.disconnect()
        with self._telling():
            self._disk.close()

    @contextmanager
    def _telling(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error
