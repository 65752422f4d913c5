"""A recording in the viewer: drawn anew, opened at a hole; a torn one up to its last whole hole."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.experimental import ViewerClient

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.errors import DeviceError, DocumentError
from cell.recording import layout
from cell.recording.audit_picture import comparison_blueprint, is_comparison
from cell.recording.hole_scene import order_of_views
from cell.recording.integrity import check_seal
from cell.recording.pages import Page, read_pages
from cell.recording.rows import damage_explained, open_chunks
from cell.recording.scene import Scene
from cell.recording.stream import encode
from cell.recording.viewer import (
    LIVE_PORT,
    free_port,
    has_display,
    hub_url,
    viewer_process,
    web_url,
)
from cell.recording.web_page import guarded_page

PATIENCE_S = 60.0
SETTLE_S = 6.0  # until a software renderer has drawn, and the viewer has said what it says first


@dataclass(frozen=True)
class Photograph:
    """A picture of the viewer (PNG), and what its views complain about."""

    png: bytes
    complaints: tuple[str, ...]


@dataclass(frozen=True)
class Survey:
    """What a recording holds: its holes and their places on the time line (the last, where one was
    visited twice), and sentences on what is not as it was closed.
    """

    log: Path
    holes: Mapping[str, int]
    warnings: tuple[str, ...]

    def find(self, hole_id: str) -> int:
        """Return the place of a hole.

        Raises:
            DocumentError: it is not in the recording.
        """
        if hole_id not in self.holes:
            raise DocumentError(f"holds no hole {hole_id!r}; it holds "
                                f"{', '.join(self.holes) or 'none'}", source=str(self.log))
        return self.holes[hole_id]


def survey(log: Path) -> Survey:
    """Look through a recording before it is shown.

    Raises:
        DocumentError: it is unreadable.
    """
    if is_comparison(log):
        return Survey(log, {}, ("a picture that an audit drew, no evidence",))
    _, checks = check_seal(log)
    warnings = [check.words for check in checks if check.passed is False or check.level == "seal"]
    holes: dict[str, int] = {}
    for number, page in enumerate(read_pages(log), start=-1):  # the start comes before hole 0
        warnings += page.faults
        if isinstance(page.record, HoleRecord):
            holes[page.record.observation.hole_id] = number
    return Survey(log, holes, tuple(warnings))


def replay(log: Path, url: str, open_at: int | None = None) -> None:
    """Draw a recording anew into a viewer or hub.

    What is shown follows from the audited records alone: the picture that the file brings along
    for other viewers is not looked at.

    Args:
        log: the recording.
        url: where the viewer or hub listens.
        open_at: let it stand at this place of the time line, where nobody can tell the viewer.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: nobody takes it.
    """
    stream = rr.RecordingStream(layout.APPLICATION, recording_id=_recording_id(log))
    stream.connect_grpc(url)
    with damage_explained(log):
        if is_comparison(log):
            _send_comparison(log, stream)
        else:
            draw(log, stream, open_at)
    try:
        stream.flush(timeout_sec=PATIENCE_S)
    except (RuntimeError, ValueError) as error:
        raise DeviceError(f"does not take the recording: {error}", device="viewer") from error
    stream.disconnect()


def draw(log: Path, stream: rr.RecordingStream, open_at: int | None = None) -> None:
    """Draw a recording anew from its audited records.

    Raises:
        DocumentError: it is unreadable.
    """
    pages = read_pages(log)
    scene = Scene(stream, _begin(pages), open_at=open_at)
    for number, page in enumerate(pages):
        if isinstance(page.record, HoleRecord):
            stream.set_time(layout.HOLE_TIMELINE, sequence=number)
            for view in (page.record.observation.views[i] for i in order_of_views(page.record)):
                if view.image.size:
                    stream.log(f"{layout.CAMERA}/{view.light}", encode(view.image))
            scene.add(number, page.record)
        elif isinstance(page.record, Stop):
            scene.finish(page.record)


def _send_comparison(log: Path, stream: rr.RecordingStream) -> None:
    """Send what an audit drew: it is a picture, and was never more."""
    stream.send_blueprint(comparison_blueprint())
    with open_chunks(log) as chunks:
        stream.send_chunks(chunks)


def _recording_id(log: Path) -> str:
    return log.stem if is_comparison(log) else _begin(read_pages(log)).recording_id


def _begin(pages: Iterator[Page]) -> Start:
    start = next(pages).record
    assert isinstance(start, Start)  # `read_pages` sees to it
    return start


def show(log: Path, number: int) -> None:
    """Open a window at the `number`-th hole, and return when it was closed.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: there is no screen, or the viewer does not start.
    """
    _check_display()
    port = free_port()
    with viewer_process("--port", str(port)) as process:
        viewer = connect(port)
        replay(log, hub_url(port))
        _go_to(viewer, number)
        process.wait()


def serve(log: Path, open_at: int | None, tell: Callable[[str], None]) -> None:
    """Serve a recording to browsers of this machine until interrupted; `tell` gets the address.

    Args:
        log: the recording.
        open_at: the place on the time line that it opens at, the first for None.
        tell: gets the address.

    Raises:
        DocumentError: the recording is unreadable.
        DeviceError: the server does not start.
    """
    port, web_port = free_port(), free_port()
    with (viewer_process("--serve-web", "--port", str(port), "--web-viewer-port", str(web_port)
                         ) as process, guarded_page(web_port) as page):
        replay(log, hub_url(port), open_at)
        tell(web_url(page, port))
        process.wait()


def wait_for_run(tell: Callable[[str], None] | None) -> None:
    """Open a window, or serve a page whose address `tell` gets, for what is measured live.

    Raises:
        DeviceError: there is no screen, or the port is taken.
    """
    web: tuple[str, ...] = ()
    web_port = free_port()
    if tell is None:
        _check_display()
    else:
        web = ("--serve-web", "--web-viewer-port", str(web_port))
    with viewer_process("--port", str(LIVE_PORT), *web) as process, ExitStack() as closing:
        if tell is not None:
            tell(web_url(closing.enter_context(guarded_page(web_port)), LIVE_PORT))
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
        viewer = connect(port)
        replay(log, hub_url(port))
        _go_to(viewer, number)
        time.sleep(SETTLE_S)
        reports = [report for view in viewer.get_state().views for report in view.reports]
        return Photograph(viewer.take_screenshot(), tuple(map(str, reports)))


def _check_display() -> None:
    if not has_display():
        raise DeviceError("there is no screen here: use --web or --picture", device="viewer")


def connect(port: int) -> ViewerClient:
    """Reach a viewer that is just starting.

    Raises:
        DeviceError: it does not start.
    """
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
