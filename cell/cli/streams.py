"""Standard input, output and error: no pipe, terminal or encoding may change an exit code."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

from cell.core.errors import DocumentError, RecordingError


class _Answer(io.TextIOWrapper):
    """Standard output. A reader who has gone (`| head -1`) changes nothing; what cannot be written
    otherwise, as on a full disk, is a RecordingError.
    """

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError as error:
            self._lose(error)
        return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self._lose(error)

    def _lose(self, error: OSError) -> None:
        forget(self)  # or the interpreter tries again on its way out
        if not isinstance(error, BrokenPipeError):
            raise RecordingError("the answer cannot be written to standard output: "
                                 f"{error.strerror}") from None


class _Words(_Answer):
    """Standard error. What cannot be written is lost, and nothing else with it: a body is measured
    to its end whether or not somebody reads how far it is.
    """

    def _lose(self, error: OSError) -> None:  # noqa: ARG002
        forget(self)


def open_streams() -> None:
    """Have all three streams open, so that no file is opened in the place of a closed one, and
    writing what a narrow encoding lacks as `?`.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one
            setattr(sys, name, open(number, "w" if number else "r", closefd=False))  # noqa: SIM115
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    for name, kind in (("stdout", _Answer), ("stderr", _Words)):
        stream = getattr(sys, name)
        if type(stream) is io.TextIOWrapper:  # and not what somebody else has put there
            encoding, by_lines = stream.encoding, stream.line_buffering
            setattr(sys, name, kind(stream.detach(), encoding, "replace", line_buffering=by_lines))


def forget(stream: io.TextIOWrapper) -> None:
    """Lead a stream to nowhere: nobody reads it."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def check_words(words: list[str]) -> None:
    """Refuse words that are no text: they could neither be recorded nor found again.

    Raises:
        DocumentError: bytes that the locale's encoding does not know.
    """
    for word in words:
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            raise DocumentError("expected text in the encoding of this locale, "
                                f"{sys.getfilesystemencoding()}; came {word!a}: set the "
                                "terminal's, for instance LC_ALL=C.UTF-8")
