"""The emulated controller itself: modes, safety, motion, outputs, time. No sockets, no protocol.

Outputs are configured as the application asks for on a real controller: "low when not running".
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import IntEnum

import numpy as np

from cell.sim.controller.arm import BUILDS, Array, EmulatedArm, matrix_of, pose_of
from cell.sim.controller.motion import Halt, Motion, UnreachableError

SAFETY_DECELERATION = 15.0  # rad/s², of a stop that the safety system makes
UNLOCK_DELAY = 5.0          # s after a protective stop, by the clock on the wall as on a real one
POWER_DELAY = 0.4           # s of controller time that powering and brakes take
PARKED = np.radians([0.0, -100.0, 100.0, -90.0, -90.0, 0.0])


class Runtime(IntEnum):
    """The state of the program, as RTDE's `runtime_state` says it."""

    STOPPING, STOPPED, PLAYING, PAUSING, PAUSED, RESUMING = range(6)


class RobotMode(IntEnum):
    """RTDE's `robot_mode`: what the arm's power and brakes do."""

    POWER_OFF, POWER_ON, IDLE, RUNNING = 3, 4, 5, 7


class Safety(IntEnum):
    """RTDE's `safety_mode`."""

    NORMAL, REDUCED, PROTECTIVE_STOP, SAFEGUARD_STOP = 1, 2, 3, 5
    EMERGENCY_STOP = 7


SAFETY_BITS = {Safety.NORMAL: 1, Safety.REDUCED: 2, Safety.PROTECTIVE_STOP: 1 << 2 | 1 << 10,
               Safety.SAFEGUARD_STOP: 1 << 4 | 1 << 10,
               Safety.EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10}

Departure = Callable[[Array], Motion]


class Controller:
    """The state of a UR controller, driven on by `advance`. Metres and radians, as UR has them."""

    def __init__(self, model: str, speed: float = 1.0, serial: str = "20235500417",
                 joints: Sequence[float] | None = None) -> None:
        self.model, self.serial, self.speed = model, serial, speed
        self.arm = EmulatedArm(BUILDS[model])
        self.time = self.wall = 0.0
        self.joints = PARKED.copy() if joints is None else np.array(joints)
        self.joint_speeds = np.zeros(6)
        self.tcp_offset, self.flange_from_tcp = np.zeros(6), np.eye(4)
        self._posed: tuple[Array | None, Array] = None, np.zeros(6)
        self.payload, self.payload_cog = 3.2, (0.0, 0.0, 0.06)
        self.robot_mode, self.safety = RobotMode.RUNNING, Safety.NORMAL
        self.runtime = Runtime.STOPPED
        self.remote_control, self.emergency_button = True, False
        self.outputs = 0
        self.moves_started = 0
        self.popup = ""
        self._motion: Motion | None = None
        self._started = self._stopped_at = 0.0
        self._departures: deque[Departure] = deque()
        self._ahead: Departure | None = None
        self._powering: tuple[float, RobotMode] | None = None

    @property
    def moving(self) -> bool:
        """Whether the arm moves or is about to."""
        return self._motion is not None or bool(self._departures)

    @property
    def playing(self) -> bool:
        """Whether a program runs and the arm may move."""
        return self.runtime is Runtime.PLAYING

    @property
    def base_from_tcp(self) -> Array:
        """The TCP's pose as the controller reports it: (x, y, z, rx, ry, rz)."""
        if self._posed[0] is not self.joints:
            self._posed = self.joints, pose_of(self.arm.flange(self.joints) @ self.flange_from_tcp)
        return self._posed[1]

    @property
    def temperatures(self) -> Array:
        """The joints' temperatures in degrees C: they warm up over half an hour."""
        return 24.0 + (1.0 - np.exp(-self.time / 1800.0)) * np.array([11, 12, 11, 9, 9, 8.0])

    def set_tcp(self, pose: Array) -> None:
        """Take another TCP offset (x, y, z, rx, ry, rz)."""
        self.tcp_offset, self.flange_from_tcp = pose, matrix_of(pose)
        self._posed = None, pose

    def set_outputs(self, mask: int, levels: int) -> None:
        """Switch the digital outputs of the mask; they stay low while no program runs."""
        if self.playing:
            self.outputs = self.outputs & ~mask | levels & mask

    # --- time -----------------------------------------------------------------------------------

    def advance(self, wall: float) -> None:
        """Go on to `wall` seconds by the clock on the wall: controller time runs `speed` times."""
        self.time += (wall - self.wall) * self.speed
        self.wall = wall
        if self._powering and self.time >= self._powering[0]:
            self.robot_mode, self._powering = self._powering[1], None
        if self._motion is not None:
            self._follow(self._motion)
        if self._motion is None and self._departures and self.playing:
            self._depart()

    def _follow(self, motion: Motion) -> None:
        since = self.time - self._started
        try:
            self.joints, self.joint_speeds = motion.at(since)
        except UnreachableError as error:
            self.end_program(f"runtime error: {error}")
            return
        if since >= motion.duration:
            self._motion, self.joint_speeds = None, np.zeros(6)
            if self.playing:
                self._ahead = None

    def _depart(self) -> None:
        self._ahead = self._departures.popleft()
        self.moves_started += 1
        try:
            self._motion, self._started = self._ahead(self.joints), self.time
        except UnreachableError as error:
            self.end_program(f"runtime error: {error}")

    # --- motion ---------------------------------------------------------------------------------

    def go(self, departure: Departure) -> None:
        """Begin a move from where the arm stands; a move under way is braked first."""
        self.halt(4.0)
        self._departures.append(departure)
        self.advance(self.wall)

    def halt(self, deceleration: float) -> None:
        """Brake with a deceleration in rad/s² and forget the way that was left."""
        self._departures.clear()
        self._ahead = None
        self._brake(deceleration)

    def _brake(self, deceleration: float) -> None:
        if self._motion is not None and not isinstance(self._motion, Halt):
            self._motion = Halt(self.joints, self.joint_speeds, deceleration)
            self._started = self.time

    # --- the program ----------------------------------------------------------------------------

    def play(self) -> None:
        """Run the loaded program, or go on where it was paused: the old way is finished."""
        if self.runtime is Runtime.PAUSED and self._ahead is not None:
            self._departures.append(self._ahead)
        self.runtime = Runtime.PLAYING

    def pause(self) -> None:
        """Hold the program: the arm brakes and remembers where it was going."""
        if self.playing:
            self.runtime, self.outputs = Runtime.PAUSED, 0
            self._brake(SAFETY_DECELERATION)

    def end_program(self, popup: str = "") -> None:
        """Stop the program: the arm brakes, the outputs fall."""
        self.popup = popup or self.popup
        self.runtime, self.outputs = Runtime.STOPPED, 0
        self.halt(SAFETY_DECELERATION)

    # --- safety ---------------------------------------------------------------------------------

    def protective_stop(self) -> None:
        """Stop as after a collision."""
        self.safety, self._stopped_at = Safety.PROTECTIVE_STOP, self.wall
        self.pause()

    def unlock(self) -> bool:
        """Release a protective stop; refused during the first five seconds."""
        if self.wall - self._stopped_at < UNLOCK_DELAY:
            return False
        self.safety = Safety.NORMAL
        return True

    def safeguard(self, opened: bool) -> None:
        """Open or close the safety gate; the program goes on by itself when it closes.

        A graver stop outlasts the gate.
        """
        if opened and self.safety is Safety.NORMAL:
            self.safety = Safety.SAFEGUARD_STOP
            self.pause()
        elif not opened and self.safety is Safety.SAFEGUARD_STOP:
            self.safety = Safety.NORMAL
            if self.runtime is Runtime.PAUSED:
                self.play()

    def emergency_stop(self, pressed: bool) -> None:
        """Press or release the button. Release alone brings nothing back."""
        self.emergency_button = pressed
        if pressed:
            self.end_program()
            self.safety, self.robot_mode = Safety.EMERGENCY_STOP, RobotMode.POWER_OFF

    def restart_safety(self) -> None:
        """Restart the safety system: normal again unless the button is still pressed."""
        if not self.emergency_button and self.safety is Safety.EMERGENCY_STOP:
            self.safety = Safety.NORMAL

    def power(self, wanted: RobotMode) -> None:
        """Power on (IDLE), release the brakes (RUNNING) or power off, which takes a moment."""
        if self.safety in (Safety.NORMAL, Safety.REDUCED) or wanted is RobotMode.POWER_OFF:
            self._powering = self.time + POWER_DELAY, wanted
