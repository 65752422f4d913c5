"""The referee's port, 29900: what no robot offers. Tests ask for the truth and cause faults here.

A line in, a line out. Switches take `on` or `off`: safeguard, emergency_stop, local_mode,
freeze_stream (no cyclic data), stall (the same cycle again and again), freeze (nothing is read or
answered: a pulled cable), refuse_upload. Events: protective_stop, pause, kill_program, other_tcp
(100 mm further out), cut (every client's connection ends), garbage, half_package (and then
silence), restart (as if just started, parked), die, truth (answers JSON).
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cell.sim.controller.controller import Controller

if TYPE_CHECKING:
    from cell.sim.controller.server import Server

PORT = 29900


class Referee:
    """The commands of the referee's port."""

    def __init__(self, server: Server) -> None:
        self._server, controller = server, server.controller
        self._switches: dict[str, Callable[[bool], None]] = {
            "safeguard": controller.safeguard, "emergency_stop": controller.emergency_stop,
            "local_mode": self._local_mode,
            **{name: self._fault(name)
               for name in ("freeze_stream", "stall", "freeze", "refuse_upload")},
        }
        self._events: dict[str, Callable[[], None]] = {
            "protective_stop": controller.protective_stop, "pause": controller.pause,
            "kill_program": controller.end_program, "cut": server.cut,
            "other_tcp": lambda: controller.set_tcp(np.array([0.0, 0.0, 0.1, 0.0, 0.3, 0.0])),
            "garbage": lambda: server.broadcast(os.urandom(64)),
            "half_package": self._half_package,
            "restart": lambda: server.restart(Controller(controller.model, controller.speed)),
            "die": lambda: os._exit(1),
        }

    def answer(self, line: str) -> str:
        """Obey one command."""
        name, _, switch = line.strip().partition(" ")
        if name == "truth":
            return json.dumps(self._truth())
        if name in self._events and not switch:
            self._events[name]()
        elif name in self._switches and switch in ("on", "off"):
            self._switches[name](switch == "on")
        else:
            return f"unknown: {line.strip()}"
        return "ok"

    def _truth(self) -> dict[str, object]:
        controller = self._server.controller
        return {"joints": controller.joints.tolist(), "time": controller.time,
                "joint_speeds": controller.joint_speeds.tolist(), "outputs": controller.outputs,
                "runtime": controller.runtime.name, "safety": controller.safety.name,
                "moves_started": controller.moves_started, "uploads": self._server.uploads,
                "popup": controller.popup, "cpu_s": sum(os.times()[:2])}

    def _local_mode(self, local: bool) -> None:
        self._server.controller.remote_control = not local
        if local:
            self._server.controller.end_program()

    def _half_package(self) -> None:
        self._server.broadcast(b"\x01\x00U\x01")
        self._server.faults.add("freeze_stream")

    def _fault(self, name: str) -> Callable[[bool], None]:
        def switch(active: bool) -> None:
            (self._server.faults.add if active else self._server.faults.discard)(name)
        return switch
