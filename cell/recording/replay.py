"""A recording in the viewer: sent over loopback, opened at a hole; a torn one to its last whole."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.experimental import ViewerClient

from cell.core.documents.papers import Papers
from cell.core.documents.record import Start
from cell.core.errors import DeviceError, DocumentError
from cell.recording import layout
from cell.recording.blueprint import build_blueprint
from cell.recording.pages import read_pages
from cell.recording.rows import open_chunks, read_rows
from cell.recording.viewer import (
    LIVE_PORT,
    free_port,
    has_display,
    hub_url,
    viewer_process,
    web_url,
)

PATIENCE_S = 60.0
SETTLE_S = 3.0  # until a software renderer has drawn what it was told


@dataclass(frozen=True)
class Photograph:
    """A picture of the viewer (PNG), and what its views complain about."""

    png: bytes
    complaints: tuple[str, ...]


def find_hole(log: Path, hole_id: str | None) -> int:
    """Find the place of a hole on the time line: the last, where it was visited twice; the first
    place of all for None.

    Raises:
        DocumentError: the recording is unreadable, or the hole is not in it.
    """
    found = {row.first(layout.HOLE.record)["observation"]["hole_id"]:
             row.number(layout.HOLE_TIMELINE)
             for row in read_rows(log) if row.path == layout.HOLE.path}
    if hole_id is None:
        return 0
    number = found.get(hole_id)
    if number is None:
        raise DocumentError(f"holds no hole {hole_id!r}; it holds {', '.join(found) or 'none'}",
                            source=str(log))
    return number


def replay(log: Path, url: str) -> None:
    """Send a recording and its layout to a viewer or hub.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: nobody takes it.
    """
    start = next(read_pages(log)).record
    assert isinstance(start, Start)  # `read_pages` sees to it
    stream = rr.RecordingStream(layout.APPLICATION, recording_id=start.recording_id)
    stream.connect_grpc(url)
    stream.send_blueprint(build_blueprint(Papers.parse(start.papers, start.set_id)))
    with open_chunks(log) as chunks:
        stream.send_chunks(chunks)
    try:
        stream.flush(timeout_sec=PATIENCE_S)
    except (RuntimeError, ValueError) as error:
        raise DeviceError(f"does not take the recording: {error}", device="viewer") from error
    stream.disconnect()


def show(log: Path, number: int) -> None:
    """Open a window at the `number`-th hole, and return when it was closed.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: there is no screen, or the viewer does not start.
    """
    _check_display()
    port = free_port()
    with viewer_process("--port", str(port)) as process:
        viewer = _connect(port)
        replay(log, hub_url(port))
        _go_to(viewer, number)
        process.wait()


def serve(log: Path, tell: Callable[[str], None]) -> None:
    """Serve a recording to browsers of this machine until interrupted; `tell` gets the address.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: the server does not start.
    """
    port, web_port = free_port(), free_port()
    with viewer_process("--serve-web", "--port", str(port),
                        "--web-viewer-port", str(web_port)) as process:
        replay(log, hub_url(port))
        tell(web_url(web_port, port))
        process.wait()


def wait_for_run(tell: Callable[[str], None] | None) -> None:
    """Open a window, or serve a page whose address `tell` gets, for what is measured live.

    Raises:
        DeviceError: there is no screen, or the port is taken.
    """
    web_port = free_port()
    web = ("--serve-web", "--web-viewer-port", str(web_port)) if tell is not None else ()
    if tell is None:
        _check_display()
    with viewer_process("--port", str(LIVE_PORT), *web) as process:
        if tell is not None:
            tell(web_url(web_port, LIVE_PORT))
        if process.wait():
            raise DeviceError(f"ended at once: is the port {LIVE_PORT} of another viewer?",
                              device="viewer")


def photograph(log: Path, number: int) -> Photograph:
    """Take a picture of the viewer at the `number`-th hole, without a screen.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: the viewer does not start.
    """
    port = free_port()
    with viewer_process("--headless", "--port", str(port)):
        viewer = _connect(port)
        replay(log, hub_url(port))
        _go_to(viewer, number)
        time.sleep(SETTLE_S)
        reports = [report for view in viewer.get_state().views for report in view.reports]
        return Photograph(viewer.take_screenshot(), tuple(map(str, reports)))


def _check_display() -> None:
    if not has_display():
        raise DeviceError("there is no screen here: use --web or --picture", device="viewer")


def _connect(port: int) -> ViewerClient:
    """Reach a viewer that is just starting."""
    for _ in _until(PATIENCE_S):
        try:
            viewer = ViewerClient.connect(hub_url(port))
            viewer.get_state()
        except (ConnectionError, RuntimeError, OSError):
            continue
        return viewer
    raise DeviceError("does not start: it needs a graphics card or a software renderer "
                      "(mesa-vulkan-drivers)", device="viewer")


def _go_to(viewer: ViewerClient, number: int) -> None:
    """Show the `number`-th hole, at rest, once it has arrived."""
    for _ in _until(PATIENCE_S):
        if any(timeline.name == layout.HOLE_TIMELINE and (timeline.end or 0) >= number
               for recording in viewer.get_state().recordings for timeline in recording.timelines):
            break
    viewer.set_time(layout.HOLE_TIMELINE, sequence=number, play_state="paused")


def _until(seconds: float) -> Iterator[None]:
    """Try again and again, for some seconds."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        yield
        time.sleep(0.2)
