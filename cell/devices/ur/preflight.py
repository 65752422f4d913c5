"""What must be true before the client is started, asked by plain sockets with time limits.

The client itself would wait for ever on a controller that accepts a connection and is silent.
"""

from __future__ import annotations

import re
import socket
import struct
import time
from dataclasses import dataclass

from cell.core.errors import DeviceError
from cell.devices.ur.dashboard import Dashboard
from cell.devices.ur.states import state_of_safety, stopped

RTDE_PORT, SCRIPT_PORT, PRIMARY_PORT = 30004, 30003, 30001
TIMEOUT = 2.0
OLDEST = (5, 6)  # the first PolyScope that says its payload over RTDE
PROGRAM_END = 2.0  # s that the program of an application that just died may take to end
ROBOT_STATE, KINEMATICS = 16, 5


@dataclass(frozen=True)
class Controller:
    """Who answered at the address."""

    model: str
    serial: str
    software: str
    kinematics_checksum: str


def check_controller(address: str, dashboard: Dashboard, model: str,
                     serial: str | None) -> Controller:
    """Check that the robot at the address is the one meant and may move.

    Raises:
        DeviceError: nobody there, silent, another robot, not powered, or busy with a program.
        RobotStoppedError: local mode, or stopped by its safety.
    """
    for port in (RTDE_PORT, SCRIPT_PORT):
        _try_port(address, port)
    _check_rtde(address)
    found = Controller(_check_model(dashboard, model), _check_serial(dashboard, serial),
                       _check_version(dashboard), kinematics_checksum(address))
    check_may_move(dashboard)
    _check_free(dashboard)
    return found


def check_may_move(dashboard: Dashboard) -> None:
    """Check remote control, safety and power."""
    if "true" not in dashboard.ask("is in remote control"):
        raise stopped("local_mode", "the pendant is in local control")
    safety = safety_mode(dashboard)
    if (state := state_of_safety(safety)) is not None:
        raise stopped(state, f"safety mode {safety}")
    mode = dashboard.ask("robotmode").rpartition(" ")[2]
    if mode != "RUNNING":
        raise DeviceError(f"the arm is not ready (mode {mode}): power it on and release its brakes",
                          device="robot")


def safety_mode(dashboard: Dashboard) -> str:
    """Ask for the safety mode, as a word in capitals."""
    return dashboard.ask("safetymode").rpartition(" ")[2]


def kinematics_checksum(address: str) -> str:
    """Read the checksums of the arm's calibration from the primary interface; empty if not told."""
    try:
        with socket.create_connection((address, PRIMARY_PORT), timeout=TIMEOUT) as link:
            return _wait_for_kinematics(link)
    except OSError:
        return ""


def _wait_for_kinematics(link: socket.socket) -> str:
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        length, kind = struct.unpack(">iB", _read(link, 5))
        content = _read(link, length - 5)
        while kind == ROBOT_STATE and len(content) >= 5:
            size, part = struct.unpack_from(">iB", content)
            if part == KINEMATICS and size >= 29:
                return "-".join(f"{sum_:08x}" for sum_ in struct.unpack_from(">6I", content, 5))
            content = content[max(size, 5):]
    return ""


def _check_rtde(address: str) -> None:
    """Ask for protocol version 2: a controller that hangs is found here and not in the client."""
    try:
        with socket.create_connection((address, RTDE_PORT), timeout=TIMEOUT) as link:
            link.sendall(struct.pack(">HBH", 5, ord("V"), 2))
            accepted = _read(link, 4)[3]
    except OSError as error:
        raise DeviceError(f"the controller at {address}:{RTDE_PORT} does not speak RTDE: {error}",
                          device="robot") from error
    if not accepted:
        raise DeviceError(f"the controller at {address} refuses RTDE protocol 2", device="robot")


def _check_model(dashboard: Dashboard, wanted: str) -> str:
    """Compare the model; the dashboard of a UR10e says UR10."""
    answer = dashboard.ask("get robot model")
    if answer.lower().removesuffix("e") != wanted.removesuffix("e"):
        raise DeviceError(f"the cell's file says {wanted}, the controller is a {answer}",
                          device="robot")
    return wanted


def _check_serial(dashboard: Dashboard, wanted: str | None) -> str:
    serial = dashboard.ask("get serial number")
    if not serial.isdigit():
        raise DeviceError(f"the controller answers no serial number but {serial!r}", device="robot")
    if wanted is not None and serial != wanted:
        raise DeviceError(f"the cell's file says robot {wanted}, this is robot {serial}",
                          device="robot")
    return serial


def _check_version(dashboard: Dashboard) -> str:
    answer = dashboard.ask("PolyscopeVersion")
    numbers = re.search(r"(\d+)\.(\d+)[.\d]*", answer)
    if numbers is None or not OLDEST <= (int(numbers[1]), int(numbers[2])) < (6, 0):
        raise DeviceError(f"needs PolyScope {OLDEST[0]}.{OLDEST[1]} or newer of version 5, found "
                          f"{answer!r}", device="robot")
    return numbers[0]


def _check_free(dashboard: Dashboard) -> None:
    """Refuse to end somebody's program; that of a dead application ends by itself."""
    deadline = time.monotonic() + PROGRAM_END
    while "true" in dashboard.ask("running"):
        if time.monotonic() > deadline:
            raise DeviceError("a program is running on the robot: another application or the "
                              "pendant holds it; stop that first", device="robot")
        time.sleep(0.1)


def _try_port(address: str, port: int) -> None:
    try:
        socket.create_connection((address, port), timeout=TIMEOUT).close()
    except OSError as error:
        raise DeviceError(f"nobody answers at {address}:{port} ({error}): check the address, the "
                          "cable and that the controller is on", device="robot") from error


def _read(link: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = link.recv(count - len(data))
        if not more:
            raise ConnectionError("connection closed")
        data += more
    return data
