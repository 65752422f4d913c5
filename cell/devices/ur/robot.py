"""The arm: moves that are believed only when verified, and a stop that does not need the client."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from cell.core.documents.station import RobotSettings
from cell.core.errors import DeviceError
from cell.core.kinematics import JOINT_LIMIT, arm_for
from cell.core.ports import Joints, Move, RobotIdentity, RobotState
from cell.devices.ur.cycle import CycleReader, in_mm, is_still
from cell.devices.ur.dashboard import Dashboard
from cell.devices.ur.link import RefusedError, WorkerLink, WorkerLostError
from cell.devices.ur.preflight import Controller, check_controller
from cell.devices.ur.recovery import clear_stop
from cell.devices.ur.states import state_of_bits, stopped

ANSWER_SECONDS = 3.0       # for a question
REST_SECONDS = 1.5         # that braking may take
SLOWEST_JOINT = 2.0         # rad/s that every joint of every model reaches
SPARE_FACTOR, SPARE_SECONDS = 1.5, 3.0  # of a move's deadline over its computed duration


class UrRobot:
    """A UR arm at `address`. Implements the port `Robot`.

    After any failed move or stop the program on the controller is ended, so that nothing resumes by
    itself, and nothing moves until `recover` was called, which a person has to have agreed to.
    `speed` is how much faster than real time an emulated controller runs; 1 for a real one.
    """

    def __init__(self, settings: RobotSettings, address: str, speed: float = 1.0) -> None:
        self._settings, self._address = settings, address
        self.speed = speed
        self._arm = arm_for(settings.model)
        self._dashboard = Dashboard(address)
        self._link: WorkerLink | None = None
        self._stopped: DeviceError | None = DeviceError("not opened yet", device="robot")
        self._reader = CycleReader(self._arm, (0.0,) * 6)
        self._stopping = threading.Lock()

    @property
    def client_pid(self) -> int | None:
        """The number of the client's process; None while there is none."""
        return self._link.pid if self._link is not None else None

    @property
    def interrupted(self) -> bool:
        """Whether something asked of the arm has not been answered: its caller was interrupted."""
        return self._link is not None and self._link.busy

    def open(self) -> RobotIdentity:
        """Connect, check that the arm may move, and say who it is."""
        try:
            return self._connect(check_controller(self._address, self._dashboard,
                                                  self._settings.model, self._settings.serial))
        except DeviceError:
            self.close()
            raise

    def move_to(self, path: Sequence[Move]) -> RobotState:
        """Go through joint moves in order and return the state reached, verified at rest.

        Raises:
            RobotStoppedError: safety, a person or a lost connection stopped the arm on its way.
            DeviceError: a move that cannot be, or an arm that did not arrive where it was sent.
        """
        for move in path:
            _check_move(move)
        cycle = self._ask("state", ANSWER_SECONDS)
        for move in path:
            cycle = self._go(move, cycle)
            self._verify(move, self._read(cycle))
        return self._read(cycle)

    def state(self) -> RobotState:
        """Read a cycle of the controller that came after the question."""
        return self._read(self._ask("state", ANSWER_SECONDS))

    def set_outputs(self, levels: dict[int, bool]) -> None:
        """Switch digital outputs and wait until they read back so."""
        self._ask("outputs", ANSWER_SECONDS, levels=levels)

    def stop(self) -> None:
        """End the program on the controller: the arm brakes, the outputs fall. Never raises."""
        if self._link is None:
            return
        with self._stopping, contextlib.suppress(DeviceError):
            if self._stopped is None:
                self._stopped = stopped("lost", "the application stopped it")
            self._dashboard.ask("stop")
            self._wait_for_rest(self._link)

    def recover(self) -> RobotState:
        """Bring the arm back after a stop that a person has looked into, and say where it stands.

        Call it only when a person has confirmed that the cause is gone: protective stops must not
        be reset by software alone. Takes more than five seconds after one.

        Raises:
            RobotStoppedError: still stopped: the safeguard is open, the button pressed, local mode.
            DeviceError: the controller does not come back.
        """
        self.stop()
        self._drop_link()
        clear_stop(self._dashboard)
        self.open()
        return self.state()

    def close(self) -> None:
        """Stop, end the client, let the controller go. Idempotent, never raises."""
        if self._link is not None:
            self.stop()
        self._drop_link()
        self._dashboard.close()
        self._stopped = DeviceError("closed", device="robot")

    # --- connecting -------------------------------------------------------------------------------

    def _connect(self, found: Controller) -> RobotIdentity:
        self._drop_link()
        self._link = self._started_link()
        self._stopped = None
        answer = self._ask("identity", ANSWER_SECONDS)
        offset = in_mm(answer["tcp_offset"])
        self._reader = CycleReader(self._arm, offset)
        self._read(answer)
        return RobotIdentity(found.model, found.serial, found.software, found.kinematics_checksum,
                             float(answer["payload_kg"]), offset)

    def _started_link(self) -> WorkerLink:
        try:
            return WorkerLink(self._address)
        except DeviceError as error:
            with contextlib.suppress(DeviceError):
                self._dashboard.ask("stop")  # its program may run by now, without a watchdog
            raise DeviceError(f"the robot's client could not start: {_plain(error.message)}",
                              device="robot") from error

    def _drop_link(self) -> None:
        if self._link is not None:
            self._link.kill()
            self._link = None

    def _wait_for_rest(self, link: WorkerLink) -> None:
        deadline = time.monotonic() + REST_SECONDS
        while time.monotonic() < deadline:
            if is_still(link.ask("state", REST_SECONDS)):
                return

    # --- asking -----------------------------------------------------------------------------------

    def _ask(self, deed: str, limit: float, **arguments: object) -> dict[str, Any]:
        if self._link is None or (self._stopped is not None and deed != "state"):
            raise self._stopped or DeviceError("not connected", device="robot")
        try:
            return self._link.ask(deed, limit, **arguments)
        except KeyboardInterrupt:
            self.stop()
            raise
        except WorkerLostError as error:
            raise self._give_up(stopped("lost", error.message)) from error
        except RefusedError as error:
            raise self._give_up(self._explain(error)) from error

    def _give_up(self, error: DeviceError) -> DeviceError:
        """End the program, so that a paused or lost move is never finished by itself."""
        self._stopped = error
        self.stop()
        return error

    def _explain(self, error: RefusedError) -> DeviceError:
        """Find what the controller's own words say about a refusal."""
        cycle = error.cycle
        state = state_of_bits(cycle.get("safety_bits", 0), cycle.get("runtime", 0))
        if state is not None:
            return stopped(state)
        if cycle.get("runtime") == 2:
            return DeviceError(error.message, device="robot")
        with contextlib.suppress(DeviceError):
            if "true" not in self._dashboard.ask("is in remote control"):
                return stopped("local_mode")
        return stopped("lost", error.message)

    # --- moving -----------------------------------------------------------------------------------

    def _go(self, move: Move, cycle: dict[str, Any]) -> dict[str, Any]:
        """Have one move made and return the cycle in which the arm had arrived."""
        slowed = self.speed * max(float(cycle["speed_fraction"]), 0.01)  # the pendant's slider
        seconds = _duration(move, cycle["joints"]) * SPARE_FACTOR / slowed + SPARE_SECONDS
        return self._ask("move", seconds + ANSWER_SECONDS, joints=list(move.joints),
                         speed=move.speed, acceleration=move.acceleration, seconds=seconds,
                         tolerance=math.radians(self._settings.arrival_deg))

    def _verify(self, move: Move, state: RobotState) -> None:
        """Believe an arrival only if the flange stands where the joints were sent, at rest."""
        wanted, reached = self._arm.forward(move.joints), self._arm.forward(state.joints)
        millimetres, radians = wanted.distance(reached)
        near = (millimetres <= self._settings.arrival_mm
                and math.degrees(radians) <= self._settings.arrival_deg)
        if not near or not state.still:
            raise self._give_up(DeviceError(
                f"did not arrive: {millimetres:.3f} mm and {math.degrees(radians):.3f} degrees off",
                device="robot"))

    def _read(self, cycle: dict[str, Any]) -> RobotState:
        try:
            return self._reader.read(cycle)
        except DeviceError as error:
            raise self._give_up(error) from error


def _check_move(move: Move) -> None:
    """Refuse what the client would not check."""
    numbers = (*move.joints, move.speed, move.acceleration)
    if len(move.joints) != 6 or not all(map(math.isfinite, numbers)):
        raise DeviceError(f"a move needs six finite joints, not {move.joints}", device="robot")
    if max(map(abs, move.joints)) > JOINT_LIMIT or move.speed <= 0 or move.acceleration <= 0:
        raise DeviceError(f"a move beyond the joint limits or without speed: {move}",
                          device="robot")


def _plain(message: str) -> str:
    """Add to the client's words what a technician can do."""
    if "in use" not in message:
        return message
    return (f"{message} Another RTDE client or an enabled fieldbus (EtherNet/IP, PROFINET, MODBUS) "
            "holds the controller's registers: disable it in the installation.")


def _duration(move: Move, start: Joints) -> float:
    """Time a move from rest to rest at its leading joint's speed and acceleration."""
    turn = float(np.abs(np.subtract(move.joints, start)).max())
    return turn / min(move.speed, SLOWEST_JOINT) + move.speed / move.acceleration
