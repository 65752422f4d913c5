"""The live view: a second stream, in a process of its own, that may fail or hang.

The run drops papers into a short queue and never waits: where the viewer is slow the oldest hole is
lost to it, where it hangs or dies nobody notices. The file is another stream and another matter.
"""

from __future__ import annotations

import logging
import pickle
import signal
import subprocess
import sys
from collections import deque
from contextlib import suppress
from threading import Event, Thread
from types import TracebackType
from typing import TypeAlias

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.recording.calibration_moment import CalibrationMoment
from cell.recording.viewer import LIVE_PORT, dying_with_parent

log = logging.getLogger(__name__)

Paper: TypeAlias = Start | HoleRecord | Stop | CalibrationMoment

Message: TypeAlias = tuple[int, Paper]
"""A paper, and its place on the time line of holes."""

WAITING = 3
"""Papers that may wait for the viewer before the oldest is dropped."""

FAREWELL_S = 3.0


class LiveView:
    """Shows runs and calibrations, one after the other, in a viewer on this machine: `cell view
    --live`.
    """

    def __init__(self, port: int = LIVE_PORT) -> None:
        """Aim at a viewer on a port of the loopback interface; it need not be there."""
        self._waiting: deque[Message] = deque(maxlen=WAITING)
        self._something, self._closing, self._holes = Event(), False, 0
        self._drawer = subprocess.Popen(
            [sys.executable, "-m", "cell.recording.live_drawer", str(port)], stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=dying_with_parent(signal.SIGKILL))
        self._carrier = Thread(target=self._carry, name="live view", daemon=True)
        self._carrier.start()

    def show(self, paper: Paper) -> None:
        """Show a paper of the run, or a moment of the calibration. Never raises, never waits."""
        self._holes = 0 if isinstance(paper, Start) else self._holes
        self._waiting.append((self._holes, paper))
        self._holes += isinstance(paper, HoleRecord)
        self._something.set()

    def close(self) -> None:
        """Give the viewer a moment for what is left, then let go of it."""
        self._closing = True
        self._something.set()
        try:
            self._drawer.wait(FAREWELL_S)
        except subprocess.TimeoutExpired:
            log.warning("the live view did not keep up")
            self._drawer.kill()
            self._drawer.wait()

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: BaseException | None,
                 _trace: TracebackType | None) -> None:
        self.close()

    def _carry(self) -> None:
        """Carry papers to the drawer, and wait for it in everybody's place."""
        assert self._drawer.stdin is not None
        with suppress(OSError), self._drawer.stdin as pipe:
            while not self._closing or self._waiting:
                self._something.wait()
                self._something.clear()
                while self._waiting:
                    pickle.dump(self._waiting.popleft(), pipe)
                    pipe.flush()
