"""Writing the recording of one body: one file, one writer thread, nothing lost silently."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import pyarrow as pa

from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.documents.result import Outcome
from cell.core.errors import DocumentError
from cell.recording import layout
from cell.recording.chain import NOTHING, link, text_hash
from cell.recording.echo import outcomes_of, say_hole_once, say_stop_once
from cell.recording.forms import Plain, form_of
from cell.recording.hole_scene import order_of_views
from cell.recording.keys import key_path, read_key
from cell.recording.picture import Picture
from cell.recording.room import missing_room
from cell.recording.seal import Closed, write_seal
from cell.recording.stream import Stream

WAITING = 1
"""Holes that may wait for the disk before `write_hole` waits too: this bounds what a kill costs."""


class Show(Protocol):
    """Someone who watches: may fail, may hang, and never holds up the file."""

    def show(self, paper: Start | HoleRecord | Stop) -> None:
        """Show one more paper of the run. Never raises, never waits."""


class Recorder:
    """The recording of one body. Holes are encoded and written while the robot drives on."""

    def __init__(self, path: Path, start: Start, live: Show | None = None) -> None:
        """Create the file, write the start record and see it on the disk.

        Raises:
            DocumentError: the file exists, its folder cannot be written or is full, or others
                can read the key that it is to be sealed with.
            RecordingError: the disk failed at the first write.
        """
        self._key = read_key(key_path())
        self._stream = _new_stream(path, start.recording_id)
        self.path, self._start, self._live = path, start, live
        self._chain, self._holes, self._views = NOTHING, 0, 0
        self._outcomes: dict[str, Outcome] = {}
        self._failure: BaseException | None = None
        self._pending: deque[Future[None]] = deque()
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recorder")
        try:
            self._hand_over(self._write_start, start, waiting=0)
        except BaseException:
            self._close()
            path.unlink(missing_ok=True)  # nothing has been seen yet: nothing is lost
            raise

    def write_hole(self, record: HoleRecord) -> None:
        """Hand one hole to the writer thread.

        Raises:
            RecordingError: this or an earlier record could not be written.
        """
        self._hand_over(self._write_hole, record, waiting=WAITING)

    def wait(self) -> None:
        """Wait until everything handed over is on the disk.

        Raises:
            RecordingError: something could not be written.
        """
        self._settle(0)

    def finish(self, stop: Stop) -> None:
        """Write the stop record, wait for the disk, close the file and seal it.

        Raises:
            RecordingError: something could not be written; what was written before stays.
        """
        try:
            self._hand_over(self._write_stop, stop, waiting=0)
        finally:
            self._close()
        self._seal(stop)

    def _seal(self, stop: Stop) -> None:
        closed = Closed(self._chain, self._holes, stop.status, self._start.recording_id,
                        self._start.versions)
        write_seal(self.path, closed, self._key)
        self.path.chmod(0o444)

    def _close(self) -> None:
        self._thread.shutdown()
        self._stream.close()

    def _hand_over(self, write: Callable[[Any], None], paper: Start | HoleRecord | Stop,
                   waiting: int) -> None:
        self._pending.append(self._thread.submit(self._unless_failed, write, paper))
        if self._live is not None:
            self._live.show(paper)
        self._settle(waiting)

    def _settle(self, waiting: int) -> None:
        """Wait until at most `waiting` records are unwritten; raise what failed so far."""
        while self._pending and (len(self._pending) > waiting or self._pending[0].done()):
            self._pending.popleft().result()

    def _unless_failed(self, write: Callable[[Any], None], paper: object) -> None:
        """Write, unless an earlier record is missing: a recording has no gaps."""
        if self._failure is not None:
            raise self._failure
        try:
            write(paper)
            self._stream.flush()
        except BaseException as failure:
            self._failure = failure
            raise

    def _write_start(self, start: Start) -> None:
        for name, text in start.papers.items():
            self._stream.write_text(f"{layout.PAPERS}/{name}", text)
        hashes = {name: text_hash(text) for name, text in start.papers.items()}
        self._write_record(layout.START, replace(start, papers=hashes))
        self._picture = Picture(self._stream.rerun, start)

    def _write_hole(self, record: HoleRecord) -> None:
        self._stream.at(layout.HOLE_TIMELINE, self._holes)
        plain = self._write_record(layout.HOLE, say_hole_once(record))
        hashes = [view["image"] for view in plain["observation"]["views"]]
        for index in order_of_views(record):
            view = record.observation.views[index]
            self._stream.at(layout.VIEW_TIMELINE, self._views + index)
            self._stream.write_image(f"{layout.CAMERA}/{view.light}", view.image, hashes[index])
        self._picture.add(self._holes, record)
        self._outcomes |= outcomes_of(record)
        self._views += len(hashes)
        self._holes += 1

    def _write_stop(self, stop: Stop) -> None:
        self._write_record(layout.STOP, say_stop_once(stop, self._outcomes))
        self._picture.finish(stop)

    def _write_record(self, place: layout.Place, record: object) -> Plain:
        form = form_of(place.kind)
        plain = form.plain(record)
        self._chain = link(self._chain, plain)
        self._stream.write_record(place, pa.array([plain], type=form.column), self._chain)
        return plain


def _new_stream(path: Path, recording_id: str) -> Stream:
    """Create the file, which no other run can then take, where its disk has room for a body."""
    try:
        if missing := missing_room(path.parent):
            raise DocumentError(missing, source=str(path))
        return Stream(path, recording_id)
    except FileExistsError:
        raise DocumentError("exists already; a recording is never overwritten",
                            source=str(path)) from None
    except OSError as error:
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None
