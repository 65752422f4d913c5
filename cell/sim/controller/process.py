"""The emulated controller as a process of its own, ended with whoever started it."""

from __future__ import annotations

import json
import math
import os
import selectors
import socket
import subprocess
import sys
from collections.abc import Sequence
from types import TracebackType

from cell.core.errors import DeviceError
from cell.sim.controller.referee import PORT as REFEREE_PORT

START_SECONDS = 30.0


class EmulatedController:
    """Start and stop an emulated UR controller on a loopback address of its own.

    Start it from a thread that lives as long as the controller shall: the kernel ends the process
    with the thread that started it.
    """

    def __init__(self, model: str, speed: float = 1.0, address: str | None = None,
                 joints: Sequence[float] | None = None) -> None:
        self._model, self._speed, self._wanted, self._joints = model, speed, address, joints
        self._process: subprocess.Popen[str] | None = None
        self._address = ""

    @property
    def address(self) -> str:
        """Where it listens: 127.x.y.z."""
        return self._address

    @property
    def pid(self) -> int:
        """The number of its process."""
        return self._running.pid

    def start(self) -> EmulatedController:
        """Start the process and wait until its ports are open; DeviceError if they do not open."""
        command = [sys.executable, "-m", "cell.sim.controller", "--model", self._model,
                   "--speed", str(self._speed), "--parent", str(os.getpid())]
        if self._wanted:
            command += ["--address", self._wanted]
        if self._joints is not None:
            command += [f"--joints={','.join(str(math.degrees(q)) for q in self._joints)}"]
        # A session of its own: Ctrl-C on the terminal is for the application, which stops the arm.
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                         text=True, start_new_session=True)
        self._address = json.loads(self._first_line())["address"]
        return self

    def stop(self) -> None:
        """End the process. Idempotent."""
        if self._process is None:
            return
        self._process.kill()
        self._process.communicate()
        self._process = None

    def tell_referee(self, command: str) -> str:
        """Cause a fault or ask for the truth: see `referee`."""
        with socket.create_connection((self.address, REFEREE_PORT), timeout=5.0) as link:
            link.sendall(command.encode() + b"\n")
            with link.makefile() as answers:
                return answers.readline().strip()

    def __enter__(self) -> EmulatedController:
        return self.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.stop()

    @property
    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise DeviceError("the emulated controller has not been started", device="robot")
        return self._process

    def _first_line(self) -> str:
        process = self._running
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)  # type: ignore[arg-type]
            line = process.stdout.readline() if selector.select(START_SECONDS) else ""  # type: ignore[union-attr]
        if line:
            return line
        process.kill()
        _, complaint = process.communicate()
        self._process = None
        raise DeviceError(f"the emulated controller did not start: {complaint.strip()}",
                          device="robot")
