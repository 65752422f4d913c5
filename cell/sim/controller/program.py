"""What the client's uploaded control program does: one command a time through the registers.

The client writes a command number into input integer register 0 and its arguments into the double
registers; the program answers in output integer register 0 (1 ready, 2 done) and takes the next
command when the client has written 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cell.sim.controller.arm import Array, matrix_of, pose_of
from cell.sim.controller.controller import Controller
from cell.sim.controller.motion import JointPath, LinePath, UnreachableError

READY, DONE = 1, 2
RUNNING_BIT = 1 << 15


class ControlProgram:
    """The register handshake and the commands that are emulated; others end the program."""

    def __init__(self, controller: Controller, registers: dict[str, Any]) -> None:
        self._controller = controller
        self._registers = registers  # input_… as the clients wrote them; output_… are written here
        self._asynchronous = self._blocked = False
        self._operation = self._writes = 0
        self._watchdog = float("inf")
        self._answer("int", 0, 0)
        self._progress(running=False)
        self._commands: dict[int, Callable[[], bool]] = {
            1: self._move_joints, 2: self._move_joints_to_pose, 3: self._move_line,
            4: self._move_line_to_joints, 29: self._set_tcp, 30: self._inverse, 31: self._protect,
            33: self._stop, 34: self._stop, 35: self._set_watchdog, 36: self._pose_within,
            37: self._joints_within, 40: self._tcp_offset, 43: self._forward, 44: self._forward_of,
            46: self._inverse, 47: self._steady, 99: self._nothing, 255: self._end,
        }

    @property
    def silence_allowed(self) -> float:
        """How long, in s, the client may write no command before the watchdog ends the program."""
        return self._watchdog

    def step(self) -> None:
        """Look at the registers and act: called each cycle and whenever a client has written."""
        if not self._controller.playing:
            return
        if self._asynchronous and not self._controller.moving:
            self._finish_asynchronous()
        command = int(self._registers.get("input_int_register_0", 0))
        if self._blocked:
            self._blocked = self._controller.moving
            if not self._blocked:
                self._answer("int", 0, DONE)
        elif command == 0:
            self._answer("int", 0, READY)
        elif self._registers["output_int_register_0"] == READY:
            self._obey(command)

    def _obey(self, command: int) -> None:
        known = self._commands.get(command)
        if known is None:
            self._controller.end_program(f"runtime error: command {command} is not emulated")
            return
        try:
            self._blocked = known()
        except UnreachableError as error:
            self._controller.end_program(f"runtime error: {error}")
            return
        if not self._blocked:
            self._answer("int", 0, DONE)

    # --- motion; each answers whether the program is blocked until the arm stands -----------------

    def _move_joints(self) -> bool:
        return self._go_joints(self._doubles(6))

    def _move_joints_to_pose(self) -> bool:
        return self._go_joints(self._joints_for(self._doubles(6)))

    def _go_joints(self, goal: Array) -> bool:
        arm, speed, acceleration = self._controller.arm, *self._doubles(2, first=6)
        return self._go(lambda joints: JointPath(arm, joints, goal, speed, acceleration))

    def _move_line(self) -> bool:
        return self._go_line(self._doubles(6))

    def _move_line_to_joints(self) -> bool:
        base_from_flange = self._controller.arm.flange(self._doubles(6))
        return self._go_line(pose_of(base_from_flange @ self._controller.flange_from_tcp))

    def _go_line(self, goal: Array) -> bool:
        controller, (speed, acceleration) = self._controller, self._doubles(2, first=6)
        wanted = goal, controller.flange_from_tcp
        return self._go(lambda q: LinePath(controller.arm, q, wanted, speed, acceleration))

    def _go(self, departure: Callable[[Array], JointPath | LinePath]) -> bool:
        if self._asynchronous:
            self._finish_asynchronous()
        self._controller.go(departure)
        return self._under_way()

    def _stop(self) -> bool:
        if self._asynchronous:
            self._finish_asynchronous()
        self._controller.halt(max(self._doubles(1)[0], 0.1))
        return self._under_way()

    def _under_way(self) -> bool:
        self._asynchronous = self._registers.get("input_int_register_1", 0) == 1
        if self._asynchronous:
            self._operation = (self._operation + 1) % 128
            self._progress(running=True)
        return not self._asynchronous

    def _finish_asynchronous(self) -> None:
        self._asynchronous = False
        self._progress(running=False)

    def _progress(self, *, running: bool) -> None:
        self._writes = (self._writes + 1) % 128
        word = self._operation << 24 | self._writes << 16 | (RUNNING_BIT if running else 0)
        self._answer("int", 2, word)

    # --- questions and settings -------------------------------------------------------------------

    def _set_tcp(self) -> bool:
        self._controller.set_tcp(self._doubles(6))
        return False

    def _tcp_offset(self) -> bool:
        return self._answer_vector(pose_of(self._controller.flange_from_tcp))

    def _inverse(self) -> bool:
        return self._answer_vector(self._joints_for(self._doubles(6)))

    def _forward(self) -> bool:
        flange = self._controller.arm.flange(self._controller.joints)
        return self._answer_vector(pose_of(flange @ self._controller.flange_from_tcp))

    def _forward_of(self) -> bool:
        """The TCP offset is taken from registers 6 to 11, whatever was left in them."""
        flange = self._controller.arm.flange(self._doubles(6))
        return self._answer_vector(pose_of(flange @ matrix_of(self._doubles(6, first=6))))

    def _joints_for(self, pose: Array) -> Array:
        controller = self._controller
        flange = matrix_of(pose) @ np.linalg.inv(controller.flange_from_tcp)
        joints = controller.arm.near(flange, controller.joints)
        if joints is None:
            raise UnreachableError(f"no joints for {np.round(pose, 4).tolist()}")
        return joints

    def _pose_within(self) -> bool:
        flange = matrix_of(self._doubles(6)) @ np.linalg.inv(self._controller.flange_from_tcp)
        found = self._controller.arm.near(flange, self._controller.joints)
        self._answer("int", 1, int(found is not None))
        return False

    def _joints_within(self) -> bool:
        self._answer("int", 1, int(np.abs(self._doubles(6)).max() <= 2 * np.pi))
        return False

    def _steady(self) -> bool:
        self._answer("int", 1, int(not self._controller.moving))
        return False

    def _set_watchdog(self) -> bool:
        self._watchdog = 1.0 / max(self._doubles(1)[0], 1e-3)
        return False

    def _protect(self) -> bool:
        self._controller.protective_stop()
        return False

    def _nothing(self) -> bool:
        return False

    def _end(self) -> bool:
        self._controller.end_program()
        return False

    # --- registers --------------------------------------------------------------------------------

    def _doubles(self, count: int, first: int = 0) -> Array:
        return np.array([self._registers.get(f"input_double_register_{first + index}", 0.0)
                         for index in range(count)])

    def _answer(self, kind: str, index: int, value: float) -> None:
        self._registers[f"output_{kind}_register_{index}"] = value

    def _answer_vector(self, values: Array) -> bool:
        for index, value in enumerate(values):
            self._answer("double", index, float(value))
        return False
