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
from cell.recording.hole_scene import LASER, RING, Colour, Trace, draw_lines, markdown
from cell.recording.memory import send_blueprint
from cell.recording.stream import Stream

SUFFIX = ".audit.rrd"
SIDE_BY_SIDE = "/comparison"


class AuditPicture:
    """A recording beside the audited one, `<log>.audit.rrd`: no evidence, only a picture."""

    def __init__(self, log: Path, start: Start) -> None:
        """Create the file.

        Raises:
            RecordingError: it exists, or cannot be created.
        """
        self.path, self._count = log.with_suffix(SUFFIX), 0
        try:
            self._stream = Stream(self.path, f"{start.recording_id}-audit")
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from None
        send_blueprint(self._stream.rerun, _blueprint())

    def add(self, record: HoleRecord, then: Outcome) -> None:
        """Draw a hole: its images, the recorded result in yellow, the new one in magenta."""
        self._stream.at(layout.HOLE_TIMELINE, self._count)
        self._count += 1
        for view in record.observation.views:
            self._stream.write_image(f"{layout.CAMERA}/{view.light}", view.image,
                                     pixel_hash(view.image))
        for name, outcome, colour in (("recorded", record.outcome, colours.ELLIPSE),
                                      ("now", then, colours.ANEW)):
            self._draw(name, _trace(outcome), colour)
        self._stream.rerun.log(SIDE_BY_SIDE, markdown(_table(record, then)))

    def close(self) -> None:
        """End the file.

        Raises:
            RecordingError: the disk is full or gone.
        """
        self._stream.flush()
        self._stream.close()

    def _draw(self, name: str, trace: Trace, colour: Colour) -> None:
        for image in (RING, LASER):
            self._stream.rerun.log(f"{image}/{name}", draw_lines(trace, {
                "ellipse": colour, "chord": colour, "across": colour, "down": colour}))


def _trace(outcome: Outcome) -> Trace:
    return outcome.located.trace if isinstance(outcome, Measured) else {}


def _table(record: HoleRecord, then: Outcome) -> str:
    was, now = _values(record.outcome), _values(then)
    rows = "".join(f"| {name} | {was.get(name, '')} | {now.get(name, '')} |\n"
                   for name in {**was, **now})
    return (f"# {record.observation.hole_id}\n\n| | recorded (yellow) | now (magenta) |\n"
            f"|---|---:|---:|\n{rows}")


def _values(outcome: Outcome) -> Mapping[str, str]:
    if isinstance(outcome, NotMeasured):
        return {"not measured": outcome.reason}
    numbers = dict(zip("xyz", outcome.centre, strict=True)) | {"d": outcome.diameter}
    return {f"{axis}, mm": f"{value:.6f}" for axis, value in numbers.items()}


def _blueprint() -> rrb.Blueprint:
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial2DView(origin=RING, name="ring light"),
            rrb.Spatial2DView(origin=LASER, name="laser"),
            rrb.TextDocumentView(origin=SIDE_BY_SIDE, name="recorded and now")),
        rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=layout.HOLE_TIMELINE, play_state="paused"),
        auto_layout=False, auto_views=False)
