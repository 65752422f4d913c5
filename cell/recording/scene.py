"""The picture of a run, drawn as its papers come: the same in the file and live."""

from __future__ import annotations

from collections.abc import Iterable

import rerun as rr

from cell.core.documents.papers import Papers
from cell.core.documents.record import HoleRecord, Start, Stop
from cell.core.documents.result import BodyResult
from cell.metrology.judge.decide import judge_run
from cell.recording import layout
from cell.recording.blueprint import build_blueprint
from cell.recording.body_scene import (
    draw_deviation,
    draw_features,
    draw_limits,
    draw_nominals,
    draw_result,
)
from cell.recording.hole_scene import Drawing, draw_camera, draw_hole, draw_summary
from cell.recording.memory import send_blueprint
from cell.recording.pages import without_images


class Scene:
    """Draws one run into a rerun stream. Everything drawn follows from the papers alone."""

    def __init__(self, stream: rr.RecordingStream, start: Start, following: bool = False,
                 open_at: int | None = None) -> None:
        """Draw the plan, and lay out the views: `following` the newest hole, or `open_at` one.

        Raises:
            DocumentError: the papers cannot be parsed.
        """
        self._stream, self._start = stream, start
        self._papers = Papers.parse(start.papers, start.set_id)
        self._records: dict[int, HoleRecord] = {}
        self._draw(draw_camera(self._papers.calibration), static=True)
        self._draw(draw_nominals(self._papers.planned_holes), static=True)
        self._draw_limits(0)
        send_blueprint(stream, build_blueprint(self._papers, following, open_at))

    def add(self, at: int, record: HoleRecord) -> None:
        """Draw the `at`-th hole. Where the alignment needs other holes first, its judgement comes
        with the end.
        """
        self._records[at] = without_images(record)
        self._at(at)
        self._draw(draw_hole(record, self._papers.calibration))
        if self._papers.job.alignment.method == "fixture":
            self._judge(at, self._result())

    def finish(self, stop: Stop) -> None:
        """Draw the judgement of the body."""
        result = stop.result or self._result()
        if self._papers.job.alignment.method != "fixture":
            for at in self._records:
                self._judge(at, result)
        self._draw(draw_result(result), static=True)
        self._draw_limits(max(self._records, default=0))

    def _draw_limits(self, at: int) -> None:
        self._at(at)
        self._draw(draw_limits())

    def _result(self) -> BodyResult:
        return judge_run(self._papers, self._start, list(self._records.values()))

    def _judge(self, at: int, result: BodyResult) -> None:
        """Draw the judgement of the holes up to the `at`-th, where that one is on the time line."""
        features = {feature.id: feature for feature in result.features}
        judged = [features[record.observation.hole_id]
                  for number, record in self._records.items() if number <= at]
        self._at(at)
        self._draw(draw_features(judged, self._papers.holes))
        self._draw(draw_deviation(judged[-1]))
        self._draw(draw_summary(self._records[at], judged[-1]))

    def _at(self, at: int) -> None:
        self._stream.set_time(layout.HOLE_TIMELINE, sequence=at)

    def _draw(self, drawings: Iterable[Drawing], static: bool = False) -> None:
        for drawing in drawings:
            path, things = drawing[0], drawing[1:]
            self._stream.log(path, things[0], *things[1:], static=static)
