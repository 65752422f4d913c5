"""The process behind the live view: papers in on standard input, a picture out to the viewer."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Iterator
from contextlib import suppress

import rerun as rr

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.recording import layout
from cell.recording.live import Message
from cell.recording.scene import Scene
from cell.recording.viewer import hub_url

PREVIEW_QUALITY = 85  # JPEG: for the eye alone
FLUSH_S = 2.0


def draw(port: int, messages: Iterator[Message]) -> None:
    """Draw a run into the viewer at `port`, paper by paper."""
    scene: Scene | None = None
    stream: rr.RecordingStream | None = None
    for at, paper in messages:
        if isinstance(paper, Start):
            stream = rr.RecordingStream(layout.APPLICATION, recording_id=paper.recording_id)
            stream.connect_grpc(hub_url(port))
            scene = Scene(stream, paper, following=True)
        elif scene is None or stream is None:
            continue  # the start was dropped: nothing can be drawn without it
        elif isinstance(paper, HoleRecord):
            _draw_previews(stream, at, paper)
            scene.add(at, paper)
        elif isinstance(paper, Stop):
            scene.finish(paper)
    if stream is not None:
        with suppress(RuntimeError, ValueError):
            stream.flush(timeout_sec=FLUSH_S)


def _draw_previews(stream: rr.RecordingStream, at: int, record: HoleRecord) -> None:
    stream.set_time(layout.HOLE_TIMELINE, sequence=at)
    for view in record.observation.views:
        image = rr.Image(view.image, color_model="L").compress(jpeg_quality=PREVIEW_QUALITY)
        stream.log(f"{layout.CAMERA}/{view.light}", image)


def _incoming() -> Iterator[Message]:
    with suppress(EOFError):
        while True:
            yield pickle.load(sys.stdin.buffer)


if __name__ == "__main__":
    draw(int(sys.argv[1]), _incoming())
