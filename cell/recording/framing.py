"""The frame of a recording file: where its whole messages end.

A file begins with 12 bytes (`RRF2`, version, options); then come messages: kind (u64), length
(u64), that many bytes. A message of kind 0 holds the index, and a trailer of 32 bytes closes the
file. What was cut anywhere is whole up to the last message that lies in it entirely.
(RRD format, "Framing"; documented as stable.)
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

from cell.core.errors import DocumentError

MAGIC, TRAILER_MAGIC = b"RRF2", b"RRF2FOOT"
HEADER, MESSAGE, TRAILER = 12, 16, 32  # bytes
INDEX = 0  # the kind of the last message


@dataclass(frozen=True)
class Frame:
    """What the frame says: the file's `size`, how much of it is `whole`, and if it was `closed`."""

    size: int
    whole: int
    closed: bool


def check_file(path: Path) -> None:
    """Refuse what is there but no file: a folder, or a pipe, at which reading would never end.

    Raises:
        DocumentError: it is something else than a file.
    """
    if path.exists() and not path.is_file():
        raise DocumentError("is not a file", source=str(path))


def read_frame(path: Path) -> Frame:
    """Walk the messages of a recording file.

    Raises:
        DocumentError: it cannot be read, or is no recording.
    """
    check_file(path)
    try:
        with path.open("rb") as file:
            return _walk(file, os.fstat(file.fileno()).st_size)
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    except ValueError as error:
        raise DocumentError(str(error), source=str(path)) from None


def copy_whole(path: Path, copy: IO[bytes]) -> None:
    """Copy the whole messages of a torn file, without its index if it has one."""
    left = read_frame(path).whole
    with path.open("rb") as file:
        while block := file.read(min(left, 1 << 20)):
            copy.write(block)
            left -= len(block)
    copy.flush()


def _walk(file: BinaryIO, size: int) -> Frame:
    if not file.read(HEADER).startswith(MAGIC) or size < HEADER:
        raise ValueError(f"is not a recording: it does not begin with {MAGIC.decode()}")
    whole = HEADER
    for kind, end in _messages(file, size):
        if kind == INDEX:
            return Frame(size, whole, _has_trailer(file, end, size))
        whole = end
    return Frame(size, whole, closed=False)


def _messages(file: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """Walk the messages that lie in the file entirely: (kind, where it ends)."""
    at = HEADER
    while at + MESSAGE <= size:
        file.seek(at)
        head = file.read(MESSAGE)
        kind, length = (int.from_bytes(head[i:i + 8], "little") for i in (0, 8))
        at += MESSAGE + length
        if at > size:
            return
        yield kind, at


def _has_trailer(file: BinaryIO, end: int, size: int) -> bool:
    file.seek(end)
    trailer = file.read(TRAILER + 1)
    return end + TRAILER == size and trailer[-12:-4] == TRAILER_MAGIC
