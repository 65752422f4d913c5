"""The picture in the file. It may fail; the file then goes on without it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial

import rerun as rr

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.recording.scene import Scene

log = logging.getLogger(__name__)


class Picture:
    """Draws a scene until it first fails, says so once, and is silent from then on."""

    def __init__(self, stream: rr.RecordingStream, start: Start) -> None:
        self._scene: Scene | None = None
        self._attempt(partial(self._begin, stream, start))

    def add(self, at: int, record: HoleRecord) -> None:
        """Draw the `at`-th hole."""
        if self._scene is not None:
            self._attempt(partial(self._scene.add, at, record))

    def finish(self, stop: Stop) -> None:
        """Draw the judgement of the body."""
        if self._scene is not None:
            self._attempt(partial(self._scene.finish, stop))

    def _begin(self, stream: rr.RecordingStream, start: Start) -> None:
        self._scene = Scene(stream, start)

    def _attempt(self, draw: Callable[[], None]) -> None:
        try:
            draw()
        except Exception:  # a picture is no measurement, whatever went wrong with it
            self._scene = None
            log.exception("the recording goes on without its picture")
