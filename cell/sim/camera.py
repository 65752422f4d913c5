"""The simulated camera as a program sees it: the camera port, and the strings of the puppet."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import deque
from contextlib import suppress
from itertools import count
from math import exp
from multiprocessing.connection import Connection
from pathlib import Path
from socket import socketpair
from typing import Any, Literal

from cell.core.errors import DeviceError
from cell.core.observation import Image
from cell.core.ports import CameraTimeoutError
from cell.sim.bodies import Body, Delivery, draw_body, master
from cell.sim.body_shop import BodyShop
from cell.sim.scene import Board, SceneDocument, Sphere, read_scene

Fault = Literal["late_image", "lost_trigger", "lost", "dark_laser", "dark_ring", "wrong_size"]

DEVICE = "simulated camera"
START_SECONDS = 30.0
ANSWER_SECONDS = 10.0
END_SECONDS = 2.0
FOREVER = 1_000_000_000
COLD, WARMER, WARM_UP_SECONDS = 23.0, 14.0, 1200.0  # degrees C
LATER = 1.5  # times the time-out: when a late image comes


class SimulatedCamera:
    """A camera in the world of `scene.yaml`, in a process of its own.

    It learns from the controller at `controller_address` over RTDE where the robot stands and which
    lights burn. `speed` is how much faster than real time an exposure passes; `timeout` is how long
    an image may take beyond that (rendering included), and how long re-arming may, in seconds on
    the wall: the laser burns meanwhile.
    """

    def __init__(self, scene_path: Path, controller_address: str, speed: float = 1.0,
                 timeout: float = 2.0) -> None:
        self._path, self._address = scene_path, controller_address
        self._speed, self._timeout = speed, timeout
        self._scene: SceneDocument = read_scene(scene_path)
        self._delivery = Delivery(self._scene.seed)
        self._size = self._scene.sensor.image_size
        self._process: subprocess.Popen[bytes] | None = None
        self._link: Connection | None = None
        self._images: deque[Image] = deque()
        self._tokens = count()
        self._opened = time.monotonic()

    # --- the port -------------------------------------------------------------------------------

    def open(self) -> tuple[int, int]:
        """Start the camera's process and connect it to the controller; return (width, height)."""
        self.close()
        ours, theirs = socketpair()
        with theirs:
            # A session of its own: Ctrl-C on the terminal is for the application alone.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "cell.sim.camera_process", str(theirs.fileno())],
                pass_fds=[theirs.fileno()], start_new_session=True)
        self._link, self._opened = Connection(ours.detach()), time.monotonic()
        try:
            self._tell(self._path, self._address, self._speed, self._delivery)
            self._answer("ready", START_SECONDS)
        except DeviceError:
            self.close()
            raise
        return self._size

    def snap(self, exposure: float) -> Image:
        """Expose once for `exposure` seconds and return the image of this very exposure.

        Raises:
            CameraTimeoutError: no image in time; re-armed.
            DeviceError: lost, or the image has the wrong size.
        """
        self.fire(exposure)
        image = self.fetch(exposure / self._speed + self._timeout)
        if image is None:
            self.rearm()
            raise CameraTimeoutError(f"no image within {self._timeout:g} s", device=DEVICE)
        if image.shape != self._size[::-1]:
            height, width = image.shape
            raise DeviceError(f"an image of {width} x {height} pixels came, not of "
                              f"{self._size[0]} x {self._size[1]}", device=DEVICE)
        return image

    def temperature(self) -> float | None:
        """Read how warm the camera is, degrees C: it warms up from when it was opened."""
        on = (time.monotonic() - self._opened) * self._speed
        return COLD + WARMER * (1.0 - exp(-on / WARM_UP_SECONDS))

    def close(self) -> None:
        """End the camera's process. Idempotent, never raises."""
        if self._link is not None:
            self._link.close()
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_SECONDS)
            self._process.kill()
            self._process.wait()
        self._link = self._process = None
        self._images.clear()

    # --- the bare device: what `snap` is made of -------------------------------------------------

    def fire(self, exposure: float) -> None:
        """Trigger an exposure. The trigger is lost if the camera is not ready."""
        self._tell("fire", time.monotonic(), exposure)

    def fetch(self, timeout: float) -> Image | None:
        """Return the oldest image in the queue, waiting for one; None if none comes in time."""
        if not self._images:
            self._receive("image", timeout)
        return self._images.popleft() if self._images else None

    def rearm(self) -> None:
        """Throw away what is queued or under way: no earlier image can come after this."""
        token = next(self._tokens)
        self._tell("rearm", token)
        while self._answer("armed", self._timeout) != token:
            pass
        self._images.clear()

    # --- the strings ----------------------------------------------------------------------------

    @property
    def scene(self) -> SceneDocument:
        """The world's design: what stands in it."""
        return self._scene

    def truth(self) -> dict[str, Any]:
        """Say the truth of the body on the station: `holes`, each in the fixture's frame, on the
        face that its drawing means (`id`, `centre_mm`, `diameter_mm`, and more). For judging only.
        """
        return self._body(self._delivery).truth()

    def deliver(self, delivery: Delivery) -> None:
        """Put another body on the station."""
        self._body(delivery)
        self._delivery = delivery
        if self._link is not None:
            self._tell("deliver", delivery)
            self._answer("done")

    def deliver_number(self, number: int) -> dict[str, str]:
        """Put body `number` of the body shop on the station; say what is wrong with which hole."""
        built = BodyShop(self._scene).build(number)
        self.deliver(built.delivery)
        return built.faults

    def deliver_master(self) -> None:
        """Put the master body on the station: measured by a CMM, sitting true in the fixture."""
        self.deliver(master(self._scene))

    def place(self, boards: tuple[Board, ...], spheres: tuple[Sphere, ...] = ()) -> None:
        """Put these targets into the cell instead of those that stand there."""
        self._tell("place", boards, spheres)
        self._answer("done")

    def set_fault(self, fault: Fault, times: int = FOREVER) -> None:
        """Have a fault strike the next `times` times; 0 ends it. `lost` kills the camera; a
        `late_image` comes after `snap` has given up.
        """
        self._tell("fault", fault, times, LATER * self._timeout)
        if fault != "lost":
            self._answer("done")

    # --- the wire -------------------------------------------------------------------------------

    def _body(self, delivery: Delivery) -> Body:
        return draw_body(self._scene, delivery)

    def _tell(self, *message: object) -> None:
        if self._link is None:
            raise DeviceError("the camera is not open", device=DEVICE)
        try:
            self._link.send(message)
        except OSError:
            raise self._lost() from None

    def _answer(self, name: str, timeout: float = ANSWER_SECONDS) -> Any:  # noqa: ANN401
        answers = self._receive(name, timeout)
        if not answers:
            raise DeviceError(f"no answer within {timeout:g} s", device=DEVICE)
        return answers[0]

    def _receive(self, name: str, timeout: float) -> list[Any]:
        """Take messages until one of this name has come; images go to their queue."""
        if self._link is None:
            raise DeviceError("the camera is not open", device=DEVICE)
        deadline = time.monotonic() + timeout
        try:
            while self._link.poll(max(deadline - time.monotonic(), 0.0)):
                came, content = self._link.recv()
                if came == "failed":
                    raise DeviceError(content, device=DEVICE)
                if came == "image":
                    self._images.append(content)
                if came == name:
                    return [content]
        except (EOFError, OSError):
            raise self._lost() from None
        return []

    def _lost(self) -> DeviceError:
        self.close()
        return DeviceError("the camera is lost: its process has ended", device=DEVICE)
