"""Keys as they are pressed, without an Enter, at a terminal that is given back as it was."""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import select
import sys
import termios
import tty
from collections import deque
from collections.abc import Iterator
from threading import Lock
from types import TracebackType
from typing import Any, TextIO

ESCAPES = re.compile(r"\x1b(\[[0-9;?]*[ -/]*[@-~]|O.|)")  # arrows and their like mean nothing here
RUBOUT, ERASE_LINE, ENTER = ("\x7f", "\b"), "\x15", ("\n", "\r")
PATIENCE_S = 0.2


class Keys:
    """The keys of a terminal; where standard input is none, nobody ever presses one.

    The terminal hands out single keys, unseen, from the first look on until `rest` or `close`.
    Ctrl-C stays what it is; of a terminal that is lost (a connection broke) no key comes any more.
    `draft` is the part of a line that `lines` has read so far.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        stream = sys.stdin if stream is None else stream
        self.here = stream is not None and not stream.closed and stream.isatty()
        self.draft = ""
        self._fd = stream.fileno() if self.here else -1
        self._before = termios.tcgetattr(self._fd) if self.here else None
        self._decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        self._typed: deque[str] = deque()
        self._lock = Lock()

    def __enter__(self) -> Keys:
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: BaseException | None,
                 _trace: TracebackType | None) -> None:
        self.close()

    def pressed(self, timeout: float = 0.0) -> str | None:
        """Return the next key that was pressed; wait for it `timeout` seconds at most."""
        if not self._typed and self._listens():
            ready, _, _ = select.select([self._fd], [], [], timeout)
            if ready:
                self._take(self._read())
        return self._typed.popleft() if self._typed else None

    def lines(self) -> Iterator[str]:
        """Read whole lines until the terminal is given back; `draft` is what a screen may show."""
        while self.here:
            key = self.pressed(PATIENCE_S)
            if key in ENTER:
                line, self.draft = self.draft, ""
                yield line
            elif key in RUBOUT:
                self.draft = self.draft[:-1]
            elif key == ERASE_LINE:
                self.draft = ""
            elif key is not None and key.isprintable():
                self.draft += key

    def rest(self) -> None:
        """Give the terminal back as it was, for a question. What was typed before it is no answer
        to it: an answer may set an arm in motion.
        """
        with self._lock:
            self._give_back()
            self._typed.clear()

    def close(self) -> None:
        """Give the terminal back for good; keys that were meant for this program go with it."""
        with self._lock:
            self._give_back(unless=self._before)
            self.here = False

    def _give_back(self, unless: list[Any] | None = None) -> None:
        """Set the terminal as it was, `unless` it is so already, and throw away what was typed."""
        with contextlib.suppress(termios.error):  # it is lost
            if self._before is not None and termios.tcgetattr(self._fd) != unless:
                termios.tcsetattr(self._fd, termios.TCSAFLUSH, self._before)

    def _listens(self) -> bool:
        """Have the terminal hand out single keys, also after a stop and `fg`."""
        with self._lock:
            try:
                if self.here and termios.tcgetattr(self._fd)[3] & termios.ICANON:
                    tty.setcbreak(self._fd, termios.TCSADRAIN)
            except termios.error:
                self.here = False
            return self.here

    def _read(self) -> bytes:
        try:
            return os.read(self._fd, 1024)
        except OSError:
            return b""

    def _take(self, raw: bytes) -> None:
        if not raw:
            self.here = False  # the terminal is gone
        self._typed.extend(ESCAPES.sub("", self._decoder.decode(raw)))
