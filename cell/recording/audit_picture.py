"""An audit to look at: the recorded and the new result over the same image, where they differ."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import rerun.blueprint as rrb

from cell.core.documents.record import HoleRecord, Start
from cell.core.documents.result import Measured, NotMeasured, Outcome
from cell.core.errors import RecordingError
from cell.recording import colours, layout
from cell.recording.forms import pixel_hash
from cell.recording.hole_scene import (
    LASER,
    RING,
    Colour,
    Trace,
    draw_lines,
    markdown,
    order_of_views,
)
from cell.recording.memory import send_blueprint
from cell.recording.stream import Stream

SUFFIX = ".audit.rrd"
SIDE_BY_SIDE = "/comparison"


def is_comparison(path: Path) -> bool:
    """Tell by its name whether a file is an audit's picture, no recording."""
    return path.name.endswith(SUFFIX)


class AuditPicture:
    """A recording beside the audited one, `<log>.audit.rrd`: no evidence, only a picture."""

    def __init__(self, log: Path, start: Start) -> None:
        """Name the file; it is created with the first hole."""
        self.path, self._count = log.with_suffix(SUFFIX), 0
        self._recording_id = f"{start.recording_id}-audit"
        self._opened: Stream | None = None

    @property
    def _stream(self) -> Stream:
        if self._opened is None:
            try:
                self._opened = Stream(self.path, self._recording_id)
            except OSError as error:
                raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from None
            send_blueprint(self._opened.rerun, comparison_blueprint())
        return self._opened

    def add(self, record: HoleRecord, then: Outcome) -> None:
        """Draw a hole: its images, the recorded result in yellow, the new one in magenta.

        Raises:
            RecordingError: the file exists, or cannot be created.
        """
        self._stream.at(layout.HOLE_TIMELINE, self._count)
        self._count += 1
        for view in (record.observation.views[index] for index in order_of_views(record)):
            self._stream.write_image(f"{layout.CAMERA}/{view.light}", view.image,
                                     pixel_hash(view.image))
        for name, outcome, colour in (("recorded", record.outcome, colours.ELLIPSE),
                                      ("now", then, colours.ANEW)):
            self._draw(name, _trace(outcome), colour)
        self._stream.rerun.log(SIDE_BY_SIDE, markdown(_table(record, then)))

    def close(self) -> None:
        """End the file, if there is one.

        Raises:
            RecordingError: the disk is full or gone.
        """
        if self._opened is not None:
            self._opened.flush()
            self._opened.close()

    def _draw(self, name: str, trace: Trace, colour: Colour) -> None:
        for image, lines in ((RING, ("ellipse", "across", "down")), (LASER, ("ellipse", "chord"))):
            drawn = draw_lines(trace, dict.fromkeys(lines, colour))
            self._stream.rerun.log(f"{image}/{name}", drawn)


def _trace(outcome: Outcome) -> Trace:
    return outcome.located.trace if isinstance(outcome, Measured) else {}


def _table(record: HoleRecord, then: Outcome) -> str:
    was, now = _values(record.outcome), _values(then)
    rows = "".join(f"| {name} | {_word(was.get(name))} | {_word(now.get(name))} "
                   f"| {_shift(was.get(name), now.get(name))} |\n" for name in {**was, **now})
    return (f"# {record.observation.hole_id}\n\n"
            f"| mm | recorded (yellow) | now (magenta) | shift |\n|---|---:|---:|---:|\n{rows}")


def _values(outcome: Outcome) -> Mapping[str, str | float]:
    if isinstance(outcome, NotMeasured):
        return {"not measured": outcome.reason}
    return {**dict(zip("xyz", outcome.centre, strict=True)), "d": outcome.diameter}


def _word(value: str | float | None) -> str:
    return f"{value:.6f}" if isinstance(value, float) else value or ""


def _shift(was: str | float | None, now: str | float | None) -> str:
    return f"{now - was:+.6f}" if isinstance(was, float) and isinstance(now, float) else ""


def comparison_blueprint() -> rrb.Blueprint:
    """Lay out both results over the images, and the numbers beside them."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial2DView(origin=RING, name="ring light"),
            rrb.Spatial2DView(origin=LASER, name="laser"),
            rrb.TextDocumentView(origin=SIDE_BY_SIDE, name="recorded and now")),
        rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=layout.HOLE_TIMELINE, play_state="paused"),
        auto_layout=False, auto_views=False)
