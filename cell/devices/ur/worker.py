"""The child process that holds every ur-rtde object. It is thrown away at the first doubt.

Started as a file, not as a module, so that it loads nothing but the client. A line of JSON in, a
line of JSON out; metres and radians. One thread does all the talking and kicks the watchdog between
requests; a second one watches the stream and ends the process when it stands still: before the
client would begin to reconnect, which ends in a crash, and without running any destructor.
"""

from __future__ import annotations

import ctypes
import json
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

LOST, STALLED, ORPHANED, PARENT_GONE = 21, 22, 23, 0
FREQUENCY = 125.0
STALL = 0.5           # s without a new cycle: the connection or the controller hangs
WATCHDOG_HZ = 3.0     # the controller ends the program when it hears less often from us
KICK = 0.14           # s between kicks
POLL = 0.005
REST = 3e-3           # rad/s: slower is still, with the noise of real joints
ENDED_EARLY = 0.4     # s at rest away from the goal after which a move has failed
READ_BACK = 1.0       # s until an output shows in the stream
DIE_WITH_PARENT = 1   # prctl's PR_SET_PDEATHSIG
VARIABLES = ["timestamp", "actual_q", "actual_qd", "actual_TCP_pose", "robot_mode", "safety_mode",
             "safety_status_bits", "runtime_state", "joint_temperatures", "target_speed_fraction",
             "actual_digital_output_bits", "payload"]
STANDARD_OUTPUTS = 8  # the configurable ones are counted on from there
PLAYING = 2           # runtime_state
MAY_MOVE = (1, 2)     # safety_mode: normal, reduced


class Worker:
    """The client's three objects and what the parent may ask of them."""

    def __init__(self, address: str) -> None:
        import rtde_control
        import rtde_io
        import rtde_receive

        self._receive = rtde_receive.RTDEReceiveInterface(address, FREQUENCY, VARIABLES)
        threading.Thread(target=self._watch, args=(os.getppid(),), daemon=True).start()
        flags = rtde_control.RTDEControlInterface
        self._control = rtde_control.RTDEControlInterface(
            address, FREQUENCY, flags.FLAG_UPLOAD_SCRIPT | flags.FLAG_NO_EXT_FT)
        self._io = rtde_io.RTDEIOInterface(address)
        self._control.setWatchdog(WATCHDOG_HZ)
        self._kicked = time.monotonic()

    def serve(self, requests: int, answers: int) -> None:
        """Answer requests until the parent closes the pipe."""
        received = b""
        while True:
            if select.select([requests], [], [], KICK)[0]:
                data = os.read(requests, 1 << 16)
                if not data:
                    os._exit(PARENT_GONE)
                *lines, received = (received + data).split(b"\n")
                for line in lines:
                    os.write(answers, self._answer(json.loads(line)))
            self._kick()

    def _answer(self, request: dict[str, Any]) -> bytes:
        deeds: dict[str, Callable[..., dict[str, Any]]] = {
            "state": self._state, "move": self._move, "outputs": self._set_outputs,
            "identity": self._identity}
        try:
            answer = {"ok": True, **deeds[request["do"]](**request["with"])}
        except (RuntimeError, ValueError, TypeError) as error:
            answer = {"ok": False, "error": f"{error}", **self._snapshot()}
        return json.dumps({"id": request["id"], **answer}).encode() + b"\n"

    # --- requests ---------------------------------------------------------------------------------

    def _identity(self) -> dict[str, Any]:
        """Say what lies on the flange, as the controller believes it."""
        offset = self._control.getTCPOffset()
        if len(offset) != 6:
            raise RuntimeError("the controller does not say its TCP offset")
        return {"tcp_offset": offset, "payload_kg": self._receive.getPayload(), **self._state()}

    def _state(self) -> dict[str, Any]:
        """Say where the arm is, by a cycle that came after the question."""
        asked = self._receive.getTimestamp()
        deadline = time.monotonic() + 2.0 * STALL  # a stall is found by the watching thread first
        while self._receive.getTimestamp() == asked:
            if time.monotonic() > deadline:
                raise RuntimeError("no new cycle from the controller")
            time.sleep(0.001)
        return self._snapshot()

    def _move(self, joints: list[float], speed: float, acceleration: float, tolerance: float,
              seconds: float) -> dict[str, Any]:
        """Go to joints and come back when the arm verifiably stands there."""
        before = self._control.getAsyncOperationProgressEx().operationId()
        if not self._control.moveJ(joints, speed, acceleration, True):
            raise RuntimeError("the control program did not take the move")
        rested, last = 0.0, time.monotonic()
        deadline = last + seconds
        while not self._arrived(joints, tolerance, before):
            self._check_playing()
            self._kick()
            time.sleep(POLL)
            step = time.monotonic() - last
            last += step
            rested = rested + step if self._ended(before) else 0.0
            if last > deadline or rested > ENDED_EARLY:
                raise RuntimeError("the arm did not reach its goal in time")
        return self._snapshot()

    def _set_outputs(self, levels: dict[str, bool]) -> dict[str, Any]:
        """Switch digital outputs and come back when the stream shows them so."""
        wanted = {int(output): level for output, level in levels.items()}
        for output, level in sorted(wanted.items(), key=lambda item: item[1]):  # off before on
            if output < STANDARD_OUTPUTS:
                self._io.setStandardDigitalOut(output, level)
            else:
                self._io.setConfigurableDigitalOut(output - STANDARD_OUTPUTS, level)
        deadline = time.monotonic() + READ_BACK
        while any(self._receive.getDigitalOutState(output) != level
                  for output, level in wanted.items()):
            if time.monotonic() > deadline:
                raise RuntimeError("the digital outputs do not read back as set")
            self._kick()
            time.sleep(0.001)
        return self._snapshot()

    # --- what is true -----------------------------------------------------------------------------

    def _arrived(self, joints: list[float], tolerance: float, before: int) -> bool:
        off = max(abs(q - goal) for q, goal in zip(self._receive.getActualQ(), joints, strict=True))
        return (self._ended(before) and off <= tolerance
                and self._receive.getRuntimeState() == PLAYING)

    def _ended(self, before: int) -> bool:
        """Whether the operation that we began has ended and the arm stands."""
        progress = self._control.getAsyncOperationProgressEx()
        ours = progress.operationId() != before and not progress.isAsyncOperationRunning()
        return ours and max(map(abs, self._receive.getActualQd())) < REST

    def _check_playing(self) -> None:
        receive = self._receive
        if receive.getRuntimeState() != PLAYING or receive.getSafetyMode() not in MAY_MOVE:
            raise RuntimeError("the control program no longer runs")

    def _snapshot(self) -> dict[str, Any]:
        """Read one cycle: all of it from between two equal time stamps."""
        receive, stamp = self._receive, -1.0
        cycle: dict[str, Any] = {}
        while stamp != receive.getTimestamp():
            stamp = receive.getTimestamp()
            cycle = {
                "time": stamp, "joints": receive.getActualQ(), "speeds": receive.getActualQd(),
                "tcp_pose": receive.getActualTCPPose(), "runtime": receive.getRuntimeState(),
                "robot_mode": receive.getRobotMode(), "safety_mode": receive.getSafetyMode(),
                "safety_bits": receive.getSafetyStatusBits(),
                "temperatures": receive.getJointTemperatures(),
                "speed_fraction": receive.getTargetSpeedFraction()}
        return cycle

    # --- staying alive ----------------------------------------------------------------------------

    def _kick(self) -> None:
        now = time.monotonic()
        if now - self._kicked > KICK and self._receive.getRuntimeState() == PLAYING:
            self._control.kickWatchdog()
            self._kicked = now

    def _watch(self, parent: int) -> None:
        stamp, quiet, last = -1.0, 0.0, time.monotonic()
        while True:
            time.sleep(0.01)
            now, latest = time.monotonic(), self._receive.getTimestamp()
            # A time in which this process itself did not run says nothing about the controller.
            quiet = quiet + min(now - last, 0.02) if latest == stamp else 0.0
            stamp, last = latest, now
            if not self._receive.isConnected():
                os._exit(LOST)
            if quiet > STALL:
                os._exit(STALLED)
            if os.getppid() != parent:
                os._exit(ORPHANED)


def main() -> None:
    """Connect to the controller at the address given, say so, and serve."""
    ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)  # a constructor may hang in C++
    answers = os.dup(1)
    os.dup2(2, 1)  # what the client prints must not be taken for an answer
    try:
        worker = Worker(sys.argv[1])
    except (RuntimeError, ValueError) as error:
        os.write(answers, json.dumps({"id": 0, "ok": False, "error": f"{error}"}).encode() + b"\n")
        os._exit(1)
    ctypes.CDLL(None).prctl(DIE_WITH_PARENT, 0)  # from here the watching thread sees it
    os.write(answers, b'{"id": 0, "ok": true}\n')
    worker.serve(0, answers)


if __name__ == "__main__":
    main()
