"""The station: the only place that chooses between real and simulated devices.

Nothing falls back from real to simulated by itself: the cell's file says which driver it is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from cell.core.documents.station import StationDocument
from cell.core.errors import DocumentError
from cell.core.ports import Camera, Lights, Robot, RobotIdentity
from cell.devices.ur import UrLights, UrRobot
from cell.devices.video import VideoCamera
from cell.sim.camera import SimulatedCamera
from cell.sim.controller.process import EmulatedController


@dataclass(frozen=True, eq=False)
class Station:
    """The open devices of one cell.

    `identity` is the robot's own word, `image_size` (width, height) the camera's.
    `world` is the simulated camera of a virtual cell, which can say the truth and put another body
    on the station; None at a real one. `speed` is how much faster than real time a virtual cell
    runs.
    """

    document: StationDocument
    robot: Robot
    lights: Lights
    camera: Camera
    identity: RobotIdentity
    image_size: tuple[int, int]
    speed: float = 1.0
    world: SimulatedCamera | None = None

    def pause(self, seconds: float, since: float) -> None:
        """Wait until `seconds` of the cell's time have passed after the monotonic time `since`."""
        time.sleep(max(0.0, since + seconds / self.speed - time.monotonic()))

    def make_safe(self) -> None:
        """Switch the lights off and bring the arm to rest. Never raises."""
        self.lights.off()
        self.robot.stop()


@contextmanager
def open_station(document: StationDocument, folder: Path, speed: float = 1.0) -> Iterator[Station]:
    """Open the devices that `cell.yaml` names; close them on every way out, the laser first.

    Args:
        document: the cell's file.
        folder: where it lies; the scene of a virtual cell is found from there.
        speed: how much faster than real time; other than 1 for simulated cells only.

    Raises:
        DocumentError: the file asks for what cannot be.
        DeviceError: a device does not answer or must not move.
    """
    if speed != 1.0 and not document.simulated:
        raise DocumentError("--speed is for simulated cells; the devices of this one are real",
                            source=f"cell {document.name}")
    with ExitStack() as closing:
        address = _controller_address(document, speed, closing)
        robot = UrRobot(document.robot, address, speed)
        closing.callback(robot.close)
        identity = robot.open()
        lights = UrLights(robot, document.robot)
        closing.callback(lights.off)
        camera = _open_camera(document, folder, address, speed)
        closing.callback(camera.close)
        image_size = camera.open()
        closing.callback(lights.off)  # last in, first out: before anything that may block
        world = camera if isinstance(camera, SimulatedCamera) else None
        yield Station(document, robot, lights, camera, identity, image_size, speed, world)


def _controller_address(document: StationDocument, speed: float, closing: ExitStack) -> str:
    robot = document.robot
    if robot.driver == "sim":
        home = [math.radians(angle) for angle in document.home_deg]
        controller = EmulatedController(robot.model, speed, robot.address, home)
        return closing.enter_context(controller).address
    if robot.address is None:
        raise DocumentError("a robot with `driver: ur` needs its `address`",
                            source=f"cell {document.name}", place="robot.address")
    return robot.address


def _open_camera(document: StationDocument, folder: Path, address: str,
                 speed: float) -> Camera:
    camera = document.camera
    if camera.driver == "video":
        return VideoCamera(camera)
    if camera.scene is None:
        raise DocumentError("a camera with `driver: sim` needs its `scene`",
                            source=f"cell {document.name}", place="camera.scene")
    return SimulatedCamera(folder / camera.scene, address, speed, camera.timeout_s)
