"""The process behind the live view: papers in on standard input, a picture out to the viewer."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Iterator
from contextlib import suppress

import rerun as rr

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.recording import layout
from cell.recording.calibration_moment import CalibrationMoment
from cell.recording.calibration_scene import CalibrationScene
from cell.recording.hole_scene import order_of_views
from cell.recording.live import Message, Paper
from cell.recording.scene import Scene
from cell.recording.viewer import hub_url

PREVIEW_QUALITY = 85  # JPEG: for the eye alone
FLUSH_S = 2.0


class Drawer:
    """Draws runs and calibrations into the viewer at `port`, each as a recording of its own."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._stream: rr.RecordingStream | None = None
        self._scene: Scene | None = None
        self._calibration: CalibrationScene | None = None

    def draw(self, at: int, paper: Paper) -> None:
        """Draw one paper more."""
        if isinstance(paper, CalibrationMoment):
            self._draw_moment(paper)
        elif isinstance(paper, Start):
            self._scene = Scene(self._begin(paper.recording_id), paper, following=True)
        elif self._scene is None or self._stream is None:
            return  # the start was dropped: nothing can be drawn without it
        elif isinstance(paper, HoleRecord):
            _draw_previews(self._stream, at, paper)
            self._scene.add(at, paper)
        elif isinstance(paper, Stop):
            self._scene.finish(paper)

    def flush(self) -> None:
        """Give the viewer a moment for what is under way."""
        if self._stream is not None:
            with suppress(RuntimeError, ValueError):
                self._stream.flush(timeout_sec=FLUSH_S)

    def _draw_moment(self, moment: CalibrationMoment) -> None:
        if self._calibration is None or self._calibration.session != moment.session:
            self._calibration = CalibrationScene(self._begin(moment.session), moment)
        self._calibration.draw(moment)

    def _begin(self, recording_id: str) -> rr.RecordingStream:
        stream = rr.RecordingStream(layout.APPLICATION, recording_id=recording_id)
        stream.connect_grpc(hub_url(self._port))
        self._stream = stream
        return stream


def _draw_previews(stream: rr.RecordingStream, at: int, record: HoleRecord) -> None:
    stream.set_time(layout.HOLE_TIMELINE, sequence=at)
    for view in (record.observation.views[index] for index in order_of_views(record)):
        image = rr.Image(view.image, color_model="L").compress(jpeg_quality=PREVIEW_QUALITY)
        stream.log(f"{layout.CAMERA}/{view.light}", image)


def _incoming() -> Iterator[Message]:
    with suppress(EOFError):
        while True:
            yield pickle.load(sys.stdin.buffer)


def main(port: int) -> None:
    """Draw what comes, to the viewer at `port`, until nothing comes any more."""
    drawer = Drawer(port)
    for at, paper in _incoming():
        drawer.draw(at, paper)
    drawer.flush()


if __name__ == "__main__":
    main(int(sys.argv[1]))
