"""What a program asks of the outside. Real and simulated devices answer alike.

House units: mm, rad, s. A device raises `DeviceError` for anything that is not an answer; a
`CameraTimeoutError` can be retried at the same pose, since the robot stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

from cell.core.errors import DeviceError
from cell.core.geometry import Transform
from cell.core.observation import Image, Light

Joints: TypeAlias = tuple[float, ...]


class CameraTimeoutError(DeviceError):
    """Report that no image came in time. The camera has been re-armed: no late image can follow."""


class RobotStoppedError(DeviceError):
    """Report that the robot's own safety or a person stopped it. `state` is a short code.

    One of `protective_stop`, `safeguard_stop`, `emergency_stop`, `local_mode`, `paused`, `lost`.
    """

    def __init__(self, message: str, *, state: str, device: str | None = "robot") -> None:
        self.state = state
        super().__init__(message, device=device)


@dataclass(frozen=True)
class RobotIdentity:
    """Who the controller says it is, as read: the calibration set must agree with it."""

    model: str
    serial: str
    software: str
    kinematics_checksum: str
    payload_kg: float
    tcp_offset: tuple[float, ...]  # x, y, z in mm and the rotation vector in rad

    def as_text(self) -> dict[str, str]:
        """Say it in words, for a record."""
        return {name: str(value) for name, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class RobotState:
    """Where the arm stands, as the controller reports it: `base_from_flange`, never the TCP."""

    base_from_flange: Transform
    joints: Joints
    controller_time: float
    still: bool
    temperatures: tuple[float, ...] = ()  # joints, degrees C


@dataclass(frozen=True)
class Move:
    """One joint move. `speed` rad/s and `acceleration` rad/s² hold for the leading joint."""

    joints: Joints
    speed: float
    acceleration: float


class Robot(Protocol):
    """An arm that goes where it is told and says where it really is."""

    def open(self) -> RobotIdentity:
        """Connect, check that it may move (mode, safety, remote control), say who it is."""

    def move_to(self, path: Sequence[Move]) -> RobotState:
        """Go through joint moves in order and return the state reached, verified at rest."""

    def state(self) -> RobotState:
        """Read the state, no older than a few controller cycles."""

    def stop(self) -> None:
        """Bring the arm to rest, bounded in time. Never raises."""

    def recover(self) -> RobotState:
        """Come back after a stop whose cause, as a person has confirmed, is gone."""

    def close(self) -> None:
        """Stop, release the controller, bounded in time. Idempotent, never raises."""


class Lights(Protocol):
    """The ring light and the laser. The laser burns only between `set("laser")` and `off()`."""

    def set(self, light: Light | None) -> None:
        """Switch exactly this light on and the other off, and wait until read back.

        Its lamp may need longer to rise: `light_rise_s` of the cell's file.
        """

    def off(self) -> None:
        """Switch both off. Never raises: it is called on every way out."""


class Camera(Protocol):
    """A camera that takes one image when told, exposed after it was told."""

    def open(self) -> tuple[int, int]:
        """Connect and arm; return the image size (width, height)."""

    def snap(self, exposure: float) -> Image:
        """Expose once for `exposure` seconds and return the image of this very exposure.

        Raises:
            CameraTimeoutError: no image in time; re-armed.
            DeviceError: lost, or the image has the wrong size.
        """

    def temperature(self) -> float | None:
        """Read how warm the camera is, degrees C; None where it does not tell."""

    def close(self) -> None:
        """Release the device, bounded in time. Idempotent, never raises."""


class Operator(Protocol):
    """A person at the cell: asked, told, and shown things."""

    def tell(self, message: str) -> None:
        """Say something that needs no answer."""

    def confirm(self, question: str) -> bool:
        """Ask for a yes or a no."""

    def choose(self, question: str, options: Sequence[str]) -> str:
        """Ask for one of `options`."""

    def ask(self, question: str, default: str | None = None) -> str:
        """Ask for a line of text."""

    def glance(self, line: str) -> None:
        """Show a line that takes the place of the glance before it."""

    def pressed(self) -> str | None:
        """Say which key was pressed since the last call, one a call, None for none. Never waits."""


LineVerdict: TypeAlias = Literal["ok", "nok", "uncertain", "incomplete"]
Command: TypeAlias = Literal["start", "abort", "reset", "bypass", "end_bypass", "stop"]
Refusal: TypeAlias = Literal["", "unknown_type", "no_body", "no_body_id", "not_ready", "master_due",
                             "result_held", "nothing_to_do", "not_named"]
Fault: TypeAlias = Literal[
    "", "protective_stop", "safeguard_stop", "emergency_stop", "local_mode", "paused", "robot_lost",
    "robot_failed", "camera_lost", "lights_lost", "laser_dark", "disk_full", "recording_failed",
    "results_lost", "holes_refused", "datum_missing", "master_failed"]
"""Why the cell stands; each is a state of the shift and a code on the line."""


@dataclass(frozen=True)
class Order:
    """A command of the line, taken at its rising edge. A start names the body and its type; a
    bypass says who wants it (`operator`) and why (`reason`), in the line's own numbers or words.
    """

    command: Command
    body_id: str = ""
    body_type: int = 0
    operator: str = ""
    reason: str = ""
    body_present: bool = True


@dataclass(frozen=True)
class LineStatus:
    """What the cell says of itself at any time. `hole` of `holes` is the progress. `clear`: the
    arm stands outside of the body's way.
    """

    state: str
    ready: bool = False
    busy: bool = False
    clear: bool = True
    master_due: bool = False
    bypass: bool = False
    trial: bool = False
    fault: Fault = ""
    hole: int = 0
    holes: int = 0
    seconds_left: int = 0


@dataclass(frozen=True)
class LineResult:
    """What the line is told of one body: it belongs to `sequence` and `body_id` and nothing else.

    `worst` is the largest deviation in mm, None where nothing was measured.
    """

    sequence: int
    body_id: str
    body_type: int
    verdict: LineVerdict
    measured: int
    out_of_tolerance: int
    missing: int
    worst: float | None
    trial: bool = True


class Line(Protocol):
    """What brings bodies and takes verdicts away: a PLC, or a person in its place."""

    def open(self) -> None:
        """Begin to listen. Raises `DeviceError` where the address cannot be used."""

    def show(self, status: LineStatus) -> None:
        """Say what the cell is doing. Never blocks."""

    def take(self, timeout: float) -> Order | None:
        """Wait for the next command, at its edge, for at most `timeout` seconds."""

    def answer(self, order: Order, refusal: Refusal = "") -> None:
        """Echo a command: accepted, or refused and why."""

    def publish(self, result: LineResult) -> None:
        """Show a result and hold it until it is acknowledged."""

    def acknowledged(self, sequence: int) -> bool:
        """Tell whether the result `sequence` has been acknowledged."""

    def alive(self) -> bool:
        """Tell whether the other side's heartbeat beats."""

    def close(self) -> None:
        """Stop listening. Idempotent, never raises."""
