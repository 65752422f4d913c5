"""Text files: read with a clear refusal, written so that a crash leaves the old or the new one."""

from __future__ import annotations

import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from cell.core.errors import DocumentError

LARGEST = 10_000_000  # bytes; a job's texts have some thousands


def read_text(path: Path) -> str:
    """Read a UTF-8 text file.

    Raises:
        DocumentError: absent, a folder, not readable, too large, or not UTF-8 text.
    """
    content = read_bytes(path, LARGEST)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[:error.start].count(b"\n") + 1
        raise DocumentError("expected UTF-8 text; came other bytes", source=str(path),
                            place=f"line {line}") from None


def read_bytes(path: Path, most: int) -> bytes:
    """Read a file of at most so many bytes; DocumentError where it is absent, unreadable, larger.

    A pipe is refused: whoever opens one waits for its other end, perhaps for ever. What has no
    end, such as a device, is not read to its end either.
    """
    try:
        if path.is_fifo():
            raise DocumentError("expected a file; came a pipe", source=str(path))
        with path.open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise DocumentError("there is no such file", source=str(path)) from None
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    if len(content) > most:
        raise DocumentError(f"expected at most {most // 10**6} MB", source=str(path))
    return content


def replace_text(path: Path, text: str) -> None:
    """Write a file in one step: after a crash it has the old text or the new, never a part. Its
    folder is made where there is none.

    Raises:
        DocumentError: the folder cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(exist_ok=True)
        with beside.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        sync(path.parent)
    except OSError as error:
        with suppress(OSError):
            beside.unlink()
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None


def append_line(path: Path, line: str) -> None:
    """Add a line to a file of lines, made where there is none; on return it is on the disk.

    A line before it that was cut short stays cut short: it does not grow together with this one.

    Raises:
        DocumentError: the disk refuses; what was written before is whole.
    """
    try:
        path.parent.mkdir(exist_ok=True)
        known = path.read_bytes() if path.exists() else b""
        cut = b"\n" if known and not known.endswith(b"\n") else b""
        with path.open("ab") as stream:
            stream.write(cut + line.encode() + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None


def read_json_lines(path: Path) -> list[str]:
    """Read the lines of a file of JSON lines, none where there is no file.

    A line that was cut short does not count: whoever wrote it did not come to the end.

    Raises:
        DocumentError: the file cannot be read.
    """
    lines = read_text(path).splitlines() if path.exists() else []
    return [line for line in lines if _is_json(line)]


def _is_json(line: str) -> bool:
    try:
        json.loads(line)
    except ValueError:
        return False
    return True


def check_writable(folder: Path, what: str) -> None:
    """Make a folder where it is absent, and try that a megabyte can be written there.

    Args:
        folder: where something will be written later.
        what: what that will be, for the sentence.

    Raises:
        DocumentError: it is a file, cannot be made or written, or is full.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as trial:
            trial.write(bytes(1_000_000))
            trial.flush()
    except FileExistsError:
        raise DocumentError(f"expected a folder for {what}; came a file",
                            source=str(folder)) from None
    except OSError as error:
        raise DocumentError(f"{what} cannot be written here: {error.strerror}",
                            source=str(folder)) from None


def sync(path: Path) -> None:
    """Make a file's contents, or the names in a folder, survive a loss of power."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
