"""The parent's end of the worker: every request has a deadline, and a late worker is killed."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from cell.core.errors import DeviceError

START_SECONDS = 12.0
REASONS = {21: "the connection to the robot is lost", 22: "the robot's data stream stands still"}


class WorkerLostError(DeviceError):
    """Report that the worker has gone or was killed: nothing is known of the arm any more."""


class RefusedError(DeviceError):
    """Report that the worker could not do it; `cycle` is what the controller said then."""

    def __init__(self, message: str, cycle: dict[str, Any]) -> None:
        self.cycle = cycle
        super().__init__(message, device="robot")


class WorkerLink:
    """One worker process. It is not restarted: another link is made."""

    def __init__(self, address: str) -> None:
        command = [sys.executable, "-P", str(Path(__file__).with_name("worker.py")), address]
        # A session of its own: Ctrl-C on the terminal is for the application, which stops the arm.
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         stderr=subprocess.DEVNULL, start_new_session=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._received = b""
        self._asked = self._answered = 0
        self._killed = False
        self._lock = threading.Lock()
        try:
            self._wait(0, START_SECONDS)
        except DeviceError:
            self.kill()
            raise

    @property
    def pid(self) -> int:
        """The number of the worker's process."""
        return self._process.pid

    @property
    def busy(self) -> bool:
        """Whether a request is unanswered: its caller was interrupted, or is another thread."""
        return self._answered < self._asked

    def ask(self, deed: str, limit: float, **arguments: object) -> dict[str, Any]:
        """Have something done and return what the controller says then.

        Raises:
            RefusedError: the worker lives and says why not.
            WorkerLostError: it has gone, or took longer than `limit` seconds and was killed.
        """
        if not self._lock.acquire(timeout=limit):
            raise RefusedError("another thread is asking the robot", {})
        try:
            if self._killed:
                raise WorkerLostError("the robot's client has ended", device="robot")
            self._asked += 1
            request = {"id": self._asked, "do": deed, "with": arguments}
            with contextlib.suppress(BrokenPipeError):  # the wait finds out why
                os.write(self._questions, json.dumps(request).encode() + b"\n")
            return self._wait(self._asked, limit)
        finally:
            self._lock.release()

    def kill(self) -> None:
        """End the process and wait for its end."""
        self._killed = True
        self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired, OSError):
            self._process.communicate(timeout=2.0)

    def _wait(self, number: int, seconds: float) -> dict[str, Any]:
        deadline = time.monotonic() + seconds
        while (answer := self._next_answer(deadline))["id"] != number:
            pass  # the answer to a request whose caller was interrupted
        if answer["ok"]:
            return answer
        raise RefusedError(answer["error"], answer)

    def _next_answer(self, deadline: float) -> dict[str, Any]:
        while b"\n" not in self._received:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._answers], [], [], left)[0]:
                self.kill()
                raise WorkerLostError("the robot's client did not answer in time", device="robot")
            data = os.read(self._answers, 1 << 16)
            if not data:
                raise WorkerLostError(self._why_it_ended(), device="robot")
            self._received += data
        line, self._received = self._received.split(b"\n", 1)
        answer: dict[str, Any] = json.loads(line)
        self._answered = answer["id"]
        return answer

    def _why_it_ended(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(timeout=2.0)
            return REASONS.get(code, f"the robot's client ended unexpectedly ({code})")
        return "the robot's client closed its answers"
