"""The file itself. rerun writes into a pipe, and one thread of ours carries it to the disk.

rerun's own file writer can neither say that a disk is full nor end once it was (`flush` and
`disconnect` may then wait for ever), and it empties a file that exists. Behind a pipe it sees none
of that: a failed write is kept and told at the next `sync`, and the pipe is drained all the same.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import termios
import time
from pathlib import Path
from threading import Lock, Thread

BLOCK = 1 << 20
POLL_S = 0.0005


class Disk:
    """A new file, and the path of a pipe into it (`entrance`)."""

    def __init__(self, path: Path) -> None:
        """Create the file, which must not exist.

        Raises:
            OSError: it exists, or cannot be created.
        """
        self._file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
        self._outlet, self._inlet = os.pipe()
        self.entrance = Path(f"/dev/fd/{self._inlet}")
        self._failure: OSError | None = None
        self._carrying = Lock()
        self._carrier = Thread(target=self._carry, name="recording to disk", daemon=True)
        self._carrier.start()

    def opened(self) -> None:
        """Let go of our end, once the writer holds its own: its close is then the end."""
        os.close(self._inlet)

    def sync(self) -> None:
        """Wait until all that went into the pipe so far is on the disk itself.

        Raises:
            OSError: something could not be written.
        """
        while self._in_the_pipe():
            time.sleep(POLL_S)
        if self._failure is not None:
            raise self._failure
        os.fsync(self._file)
        if os.fstat(self._file).st_nlink == 0:
            raise OSError(errno.ENOENT, "the file has been removed")

    def close(self) -> None:
        """Wait for the end of the pipe, then for the disk.

        Raises:
            OSError: something could not be written.
        """
        self._carrier.join()
        try:
            self.sync()
        finally:
            os.close(self._file)
            os.close(self._outlet)

    def _in_the_pipe(self) -> int:
        with self._carrying:
            count = fcntl.ioctl(self._outlet, termios.FIONREAD, bytes(4))
        return int.from_bytes(count, "little")

    def _carry(self) -> None:
        while True:
            select.select([self._outlet], [], [])
            with self._carrying:
                block = os.read(self._outlet, BLOCK)
                if not block:
                    return
                self._write(block)

    def _write(self, block: bytes) -> None:
        """Write on, up to the first failure: after it the file would have a hole."""
        try:
            while block and self._failure is None:
                block = block[os.write(self._file, block):]
        except OSError as failure:
            self._failure = failure
