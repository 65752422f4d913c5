"""A camera that runs free behind OpenCV: an index, a device, or the address of a stream.

Such a camera cannot be triggered, and buffers on the way hold images that were exposed before. So a
thread takes images as fast as they come and keeps the newest; `snap` returns the first one that
cannot have been exposed before it was called: it arrived `stale_s` and one exposure later, and at
least one whole image was thrown away in between.

Colour images become mono by Rec. 601: 0.299 red + 0.587 green + 0.114 blue, as OpenCV does it. The
exposure time is the device's own: set it, and switch automatics off, with the maker's tool. A
stream that changes its size on the way is scaled by FFmpeg unseen; the size at `open` is true.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import cv2
import numpy as np

from cell.core.documents.station import CameraSettings
from cell.core.errors import DeviceError
from cell.core.observation import Image
from cell.core.ports import CameraTimeoutError

DEVICE = "camera"
OPEN_SECONDS = 10.0
DEAD_SECONDS = 10.0  # a stream that sends nothing for so long has ended
CLOSE_SECONDS = 2.0


@dataclass(frozen=True, eq=False)
class _Arrival:
    """An image, when it arrived (monotonic s), and how many had arrived up to it."""

    image: Image
    time: float
    number: int


class VideoCamera:
    """The camera at `settings.source`. Implements the port `Camera`."""

    def __init__(self, settings: CameraSettings) -> None:
        self._settings = settings
        self._source: _Source | None = None
        self._size = (0, 0)

    def open(self) -> tuple[int, int]:
        """Open the source and wait for its first image; return (width, height)."""
        self.close()
        if self._settings.source is None:
            raise DeviceError("a camera with `driver: video` needs its `source`", device=DEVICE)
        self._source = _Source(self._settings.source)
        first = self._source.after(time.monotonic(), 0, OPEN_SECONDS)
        if first is None:
            self.close()
            raise DeviceError(f"{self._settings.source}: no image within {OPEN_SECONDS:g} s",
                              device=DEVICE)
        height, width = first.image.shape
        self._size = width, height
        return self._size

    def snap(self, exposure: float) -> Image:
        """Return an image that was exposed after this call.

        Raises:
            CameraTimeoutError: no image in time.
            DeviceError: the source has ended, or the image has another size than the first.
        """
        if self._source is None:
            raise DeviceError("the camera is not open", device=DEVICE)
        fresh = time.monotonic() + exposure + self._settings.stale_s
        timeout = exposure + self._settings.stale_s + self._settings.timeout_s
        arrival = self._source.after(fresh, self._source.count + 1, timeout)
        if arrival is None:
            raise CameraTimeoutError(f"no image within {timeout:g} s", device=DEVICE)
        if arrival.image.shape != self._size[::-1]:
            height, width = arrival.image.shape
            raise DeviceError(f"an image of {width} x {height} pixels came, not of "
                              f"{self._size[0]} x {self._size[1]}", device=DEVICE)
        return arrival.image

    def temperature(self) -> float | None:
        """Say nothing: cameras behind OpenCV hardly ever tell."""
        return None

    def close(self) -> None:
        """Leave the source, bounded in time. Idempotent, never raises."""
        if self._source is not None:
            self._source.close()
        self._source = None


class _Source:
    """A thread that empties a video source; only it touches OpenCV's object, which may block."""

    def __init__(self, address: str | int) -> None:
        self._address = address
        self._changed = threading.Condition()
        self._newest: _Arrival | None = None
        self._failure: str | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="video source", daemon=True)
        self._thread.start()

    @property
    def count(self) -> int:
        """How many images have arrived."""
        return self._newest.number if self._newest is not None else 0

    def after(self, moment: float, number: int, timeout: float) -> _Arrival | None:
        """Wait for an image that arrived later than `moment` and than image `number`."""
        with self._changed:
            self._changed.wait_for(lambda: self._failure or self._later(moment, number), timeout)
            if self._later(moment, number):
                return self._newest
        if self._failure is not None:
            raise DeviceError(self._failure, device=DEVICE)
        return None

    def close(self) -> None:
        """Ask the thread to end, and wait for it as long as is decent."""
        self._closing = True
        self._thread.join(CLOSE_SECONDS)

    def _later(self, moment: float, number: int) -> bool:
        newest = self._newest
        return newest is not None and newest.time > moment and newest.number > number

    def _run(self) -> None:
        capture = self._opened()
        failure = f"{self._address}: cannot be opened as a video source"
        while capture.isOpened() and not self._closing:
            came, frame = capture.read()
            if not came:
                failure = f"{self._address}: the source has ended"
                break
            self._arrived(_mono(frame))
        capture.release()
        with self._changed:
            self._failure = failure
            self._changed.notify_all()

    def _opened(self) -> cv2.VideoCapture:
        if isinstance(self._address, int):
            return cv2.VideoCapture(self._address)
        capture = cv2.VideoCapture(self._address, cv2.CAP_FFMPEG,
                                   [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, int(1000 * OPEN_SECONDS),
                                    cv2.CAP_PROP_READ_TIMEOUT_MSEC, int(1000 * DEAD_SECONDS)])
        return capture if capture.isOpened() else cv2.VideoCapture(self._address)

    def _arrived(self, image: Image) -> None:
        with self._changed:
            self._newest = _Arrival(image, time.monotonic(), self.count + 1)
            self._changed.notify_all()


def _mono(frame: Image) -> Image:
    """Return a mono image: colours weighted as the module says."""
    grey = frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(grey, dtype=np.uint8)
