"""The virtual camera's own process: `python -m cell.sim.camera_process FD`, started by `camera`.

It behaves as hardware does. An exposure takes time; the scene is sampled when it begins, from the
first report that the controller sends after the trigger; a trigger that comes while an exposure is
under way is lost; an image that nobody fetches stays in the queue. It ends with its parent.
"""

from __future__ import annotations

import os
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any
from zlib import crc32

import cv2
import numpy as np

from cell.core.errors import CellError
from cell.core.observation import Image
from cell.sim.bodies import Delivery, draw_body
from cell.sim.camera_feed import ControllerFeed
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps
from cell.sim.scene import Board, Sphere, read_scene
from cell.sim.world import draw_world

LOOK_SECONDS = 1.0        # between looks whether the parent is still there
CONNECT_SECONDS = 5.0
REPORT_SECONDS = 2.0      # without a report for so long the controller has gone


class VirtualCamera:
    """A camera in a world: takes orders from `link`, sends images and answers through it."""

    def __init__(self, link: Connection, scene: Path, address: str, speed: float,
                 delivery: Delivery) -> None:
        self._link, self._speed = link, speed
        self._world = draw_world(read_scene(scene))
        self._lens = Lens(self._world.sensor)
        self._setting = Setting(self._world.base_from_fixture,
                                draw_body(self._world.scene, delivery),
                                self._world.scene.boards, self._world.scene.spheres)
        self._feed = ControllerFeed(address, CONNECT_SECONDS)
        self._chance = np.random.default_rng([self._world.scene.seed, *b"camera"])
        self._queue: deque[tuple[float, Image]] = deque()
        self._ready_at = 0.0
        self._faults: dict[str, int] = {}
        self._late = 0.0  # s
        self._orders: dict[str, Callable[..., None]] = {
            "fire": self._fire, "rearm": self._rearm, "deliver": self._deliver,
            "place": self._place, "fault": self._fault}

    def open(self) -> None:
        """Connect to the controller and say the image size."""
        self._feed.open()
        self._follow(self._feed.renew(time.monotonic() + CONNECT_SECONDS))
        self._lens.prepare()
        self._link.send(("ready", self._world.sensor.camera.image_size))

    def run(self) -> None:
        """Serve until the other end goes: it closes the link, or is no longer the parent."""
        parent = os.getppid()
        while os.getppid() == parent:
            sources: list[Any] = [self._link, *([self._feed] if self._feed.connected else [])]
            due = self._queue[0][0] - time.monotonic() if self._queue else LOOK_SECONDS
            ready: list[Any] = wait(sources, min(max(due, 0.0), LOOK_SECONDS))
            if self._feed in ready:
                self._follow(self._feed.follow())
            if self._link in ready:
                name, *content = self._link.recv()
                self._orders[name](*content)
            self._send_due()

    def _fire(self, sent_at: float, exposure: float) -> None:
        if sent_at < self._ready_at or self._happens("lost_trigger"):
            return
        begun = time.monotonic()
        image = self._expose(exposure)
        done = max(begun + exposure / self._speed, time.monotonic())
        self._ready_at = done
        late = self._late if self._happens("late_image") else 0.0
        self._queue.append((done + late, image))

    def _expose(self, exposure: float) -> Image:
        self._look()
        reading = self._feed.reading
        if reading is None:
            raise CellError("the controller has never reported")
        true = self._world.arm.flange(reading.base_from_flange, reading.joints, reading.time)
        pose = true @ self._world.flange_from_camera
        wiring = self._world.scene.wiring
        ring = bool(reading.outputs >> wiring.ring & 1) and not self._happens("dark_ring")
        laser = bool(reading.outputs >> wiring.laser & 1) and not self._happens("dark_laser")
        grain = crc32(np.round(pose.matrix, 4).tobytes())  # standing still, the same speckles
        lamps = Lamps(self._world.sensor, ring, laser, grain)
        image = render(self._lens, self._setting, pose, lamps, exposure, self._chance)
        return image[::2, ::2].copy() if self._happens("wrong_size") else image

    def _look(self) -> None:
        """Learn where the robot is now; try again if the controller had gone."""
        if not self._feed.connected:
            try:
                self._feed.open()
            except CellError:
                return
        self._follow(self._feed.renew(time.monotonic() + REPORT_SECONDS))

    def _follow(self, readings: list[Any]) -> None:
        for reading in readings:
            self._world.arm.follow(reading.joints, reading.time)

    def _send_due(self) -> None:
        while self._queue and self._queue[0][0] <= time.monotonic():
            self._link.send(("image", self._queue.popleft()[1]))

    def _rearm(self, token: int) -> None:
        self._queue.clear()
        self._ready_at = 0.0
        self._link.send(("armed", token))

    def _deliver(self, delivery: Delivery | None) -> None:
        body = None if delivery is None else draw_body(self._world.scene, delivery)
        self._setting = replace(self._setting, body=body)
        self._link.send(("done", None))

    def _place(self, boards: tuple[Board, ...], spheres: tuple[Sphere, ...]) -> None:
        self._setting = replace(self._setting, boards=boards, spheres=spheres)
        self._link.send(("done", None))

    def _fault(self, name: str, times: int, late: float) -> None:
        if name == "lost":
            os._exit(1)
        self._faults[name], self._late = times, late
        self._link.send(("done", None))

    def _happens(self, fault: str) -> bool:
        """Tell whether a fault strikes now, and count it."""
        left = self._faults.get(fault, 0)
        self._faults[fault] = max(left - 1, 0)
        return left > 0


def main() -> None:
    """Serve the camera on the socket whose number is the argument, until its parent goes."""
    cv2.setNumThreads(1)
    link = Connection(int(sys.argv[1]))
    try:
        camera = VirtualCamera(link, *link.recv())
        camera.open()
        camera.run()
    except CellError as error:
        link.send(("failed", str(error)))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent has gone


if __name__ == "__main__":
    main()
