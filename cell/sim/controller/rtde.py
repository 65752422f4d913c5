"""RTDE, protocol version 2, as the controller speaks it on port 30004.

A package is its size (uint16, big-endian, header included), its type (uint8) and its content. A
client lists the outputs it wants to read and the inputs it will write; both become recipes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from cell.sim.controller.controller import SAFETY_BITS, Controller, RobotMode, Safety

VERSION = 5, 14, 0, 1031110
HEADER = struct.Struct(">HB")

FORMATS = {"DOUBLE": "d", "INT32": "i", "UINT32": "I", "UINT64": "Q", "UINT8": "B", "BOOL": "?",
           "VECTOR3D": "3d", "VECTOR6D": "6d", "VECTOR6INT32": "6i", "VECTOR6UINT32": "6I"}

Value = float | tuple[float, ...]
Values = dict[str, Value]

OUTPUT_TYPES = {
    "timestamp": "DOUBLE", "actual_execution_time": "DOUBLE", "speed_scaling": "DOUBLE",
    "target_speed_fraction": "DOUBLE", "actual_momentum": "DOUBLE", "payload": "DOUBLE",
    "actual_main_voltage": "DOUBLE", "actual_robot_voltage": "DOUBLE",
    "actual_robot_current": "DOUBLE", "standard_analog_input0": "DOUBLE",
    "standard_analog_input1": "DOUBLE", "standard_analog_output0": "DOUBLE",
    "standard_analog_output1": "DOUBLE", "actual_digital_input_bits": "UINT64",
    "actual_digital_output_bits": "UINT64", "robot_mode": "INT32", "safety_mode": "INT32",
    "runtime_state": "UINT32", "robot_status_bits": "UINT32", "safety_status_bits": "UINT32",
    "joint_mode": "VECTOR6INT32", "payload_cog": "VECTOR3D",
    "actual_tool_accelerometer": "VECTOR3D", "payload_inertia": "VECTOR6D",
    **dict.fromkeys((
        "target_q", "target_qd", "target_qdd", "target_current", "target_moment", "actual_q",
        "actual_qd", "actual_current", "joint_control_output", "actual_TCP_pose",
        "actual_TCP_speed", "actual_TCP_force", "target_TCP_pose", "target_TCP_speed",
        "joint_temperatures", "actual_joint_voltage", "ft_raw_wrench", "tcp_offset"), "VECTOR6D"),
    **{f"output_int_register_{index}": "INT32" for index in range(48)},
    **{f"output_double_register_{index}": "DOUBLE" for index in range(48)},
}
INPUT_TYPES = {
    "speed_slider_mask": "UINT32", "speed_slider_fraction": "DOUBLE",
    "standard_digital_output_mask": "UINT8", "standard_digital_output": "UINT8",
    "configurable_digital_output_mask": "UINT8", "configurable_digital_output": "UINT8",
    "tool_digital_output_mask": "UINT8", "tool_digital_output": "UINT8",
    "standard_analog_output_mask": "UINT8", "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE", "standard_analog_output_1": "DOUBLE",
    "external_force_torque": "VECTOR6D",
    **{f"input_int_register_{index}": "INT32" for index in range(48)},
    **{f"input_double_register_{index}": "DOUBLE" for index in range(48)},
}

NOT_MODELLED: Values = {  # what this emulator has no model of: constant on every answer
    **dict.fromkeys((
        "target_qdd", "target_current", "target_moment", "actual_current", "joint_control_output",
        "actual_TCP_speed", "actual_TCP_force", "target_TCP_speed", "ft_raw_wrench",
        "payload_inertia"), (0.0,) * 6),
    "actual_joint_voltage": (48.0,) * 6, "actual_tool_accelerometer": (0.0, 0.0, -9.81),
    "actual_main_voltage": 48.0, "actual_robot_voltage": 48.0, "actual_robot_current": 0.6,
    "actual_execution_time": 0.0, "actual_momentum": 0.0, "speed_scaling": 1.0,
    "target_speed_fraction": 1.0, "standard_analog_input0": 0.0, "standard_analog_input1": 0.0,
    "standard_analog_output0": 0.0, "standard_analog_output1": 0.0, "actual_digital_input_bits": 0,
    **{f"output_int_register_{index}": 0 for index in range(48)},
    **{f"output_double_register_{index}": 0.0 for index in range(48)},
}
JOINT_RUNNING, JOINT_POWER_OFF = 253, 239


@dataclass(frozen=True)
class Recipe:
    """The variables of one package, in order, and how they are packed."""

    names: tuple[str, ...]
    types: tuple[str, ...]
    number: int

    @property
    def known(self) -> bool:
        """Whether every variable exists and is free."""
        return all(kind in FORMATS for kind in self.types)

    def pack(self, values: Values) -> bytes:
        """Put the values into one data package."""
        flat: list[float] = []
        for name in self.names:
            value = values[name]
            flat.extend(value) if isinstance(value, tuple) else flat.append(value)
        return package("U", struct.pack(self._format, self.number, *flat))

    def unpack(self, content: bytes) -> Values:
        """Take the values out of a data package; VECTOR types become tuples."""
        flat = iter(struct.unpack(self._format, content)[1:])
        lengths = (int(FORMATS[kind][:-1] or 1) for kind in self.types)
        return {name: next(flat) if length == 1 else tuple(next(flat) for _ in range(length))
                for name, length in zip(self.names, lengths, strict=True)}

    @property
    def _format(self) -> str:
        return ">B" + "".join(FORMATS[kind] for kind in self.types)


def package(kind: str, content: bytes) -> bytes:
    """Wrap content into a package."""
    return HEADER.pack(HEADER.size + len(content), ord(kind)) + content


def packages(received: bytearray) -> Iterator[tuple[str, bytes]]:
    """Take whole packages off the front of what was received."""
    while len(received) >= HEADER.size:
        size, kind = HEADER.unpack_from(received)
        if size < HEADER.size:
            raise ValueError("a package smaller than its header")
        if len(received) < size:
            return
        content = bytes(received[HEADER.size:size])
        del received[:size]
        yield chr(kind), content


def outputs_of(controller: Controller) -> Values:
    """Read what the controller has to say in one cycle."""
    joints, speeds = tuple(controller.joints.tolist()), tuple(controller.joint_speeds.tolist())
    pose = tuple(controller.base_from_tcp.tolist())
    powered = controller.robot_mode is RobotMode.RUNNING
    return NOT_MODELLED | {
        "timestamp": controller.time, "actual_q": joints, "target_q": joints, "actual_qd": speeds,
        "target_qd": speeds, "actual_TCP_pose": pose, "target_TCP_pose": pose,
        "tcp_offset": tuple(controller.tcp_offset.tolist()), "payload": controller.payload,
        "payload_cog": controller.payload_cog,
        "actual_digital_output_bits": controller.outputs, "robot_mode": controller.robot_mode,
        "safety_mode": controller.safety, "runtime_state": controller.runtime,
        "robot_status_bits": int(powered) | 2 * int(controller.playing),
        "safety_status_bits": SAFETY_BITS[Safety(controller.safety)],
        "joint_mode": (JOINT_RUNNING if powered else JOINT_POWER_OFF,) * 6,
        "joint_temperatures": tuple(np.round(controller.temperatures, 2).tolist()),
    }


class RtdeSession:
    """One RTDE client: its recipes, whether it has started, and what it wrote last."""

    def __init__(self, send: Callable[[bytes], None], write: Callable[[Values], None],
                 taken: set[str], rate: float) -> None:
        self._send, self._write, self._taken, self._rate = send, write, taken, rate
        self._owned: set[str] = set()
        self._inputs: dict[int, Recipe] = {}
        self._output: Recipe | None = None
        self._started = False
        self._period, self._due = 1.0 / rate, 0.0
        self._received = bytearray()
        self._answers: dict[str, Callable[[bytes], bytes | None]] = {
            "V": lambda content: bytes([content == b"\x00\x02"]),
            "v": lambda _: struct.pack(">4I", *VERSION), "O": self._want_outputs,
            "I": self._offer_inputs, "S": self._start, "P": self._pause, "U": self._take,
            "M": lambda _: None,
        }

    def receive(self, data: bytes) -> None:
        """Answer what the client sent."""
        self._received += data
        for kind, content in packages(self._received):
            answer = self._answers[kind](content)
            if answer is not None:
                self._send(package(kind, answer))

    def cycle(self, wall: float, values: Values) -> None:
        """Send the outputs if they are due."""
        if self._started and self._output is not None and wall >= self._due - 1e-4:
            self._due = max(self._due + self._period, wall)
            self._send(self._output.pack(values))

    def close(self) -> None:
        """Give the inputs free that this client owned."""
        self._taken -= self._owned

    def _want_outputs(self, content: bytes) -> bytes:
        frequency = struct.unpack_from(">d", content)[0]
        self._period = 1.0 / min(max(frequency, 1.0), self._rate)
        names = _names(content[8:])
        types = tuple(OUTPUT_TYPES.get(name, "NOT_FOUND") for name in names)
        self._output = Recipe(names, types, 1)
        if not self._output.known:
            self._output = None
        return b"\x01" + ",".join(types).encode()

    def _offer_inputs(self, content: bytes) -> bytes:
        names = _names(content)
        types = tuple("IN_USE" if name in self._taken - self._owned
                      else INPUT_TYPES.get(name, "NOT_FOUND") for name in names)
        recipe = Recipe(names, types, len(self._inputs) + 1)
        if recipe.known:
            self._inputs[recipe.number] = recipe
            self._owned.update(names)
            self._taken.update(names)
        return bytes([recipe.number if recipe.known else 0]) + ",".join(types).encode()

    def _start(self, _: bytes) -> bytes:
        self._started = True
        return b"\x01"

    def _pause(self, _: bytes) -> bytes:
        self._started = False
        return b"\x01"

    def _take(self, content: bytes) -> None:
        recipe = self._inputs.get(content[0])
        if recipe is not None:
            self._write(recipe.unpack(content))


def _names(content: bytes) -> tuple[str, ...]:
    return tuple(name for name in content.decode().split(",") if name)
