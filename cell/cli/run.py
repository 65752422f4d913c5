"""`cell run`: measure one body."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.table import Table

from cell.cli.words import answers, console, print_json
from cell.core.errors import IN_TOLERANCE, INTERRUPTED, OUT_OF_TOLERANCE

if TYPE_CHECKING:
    from cell.core.documents.result import BodyResult, Feature
    from cell.programs.run import Finished

COLOURS = {"in_tolerance": "green", "out_of_tolerance": "red", "uncertain": "yellow",
           "not_measured": "magenta", "incomplete": "magenta"}


def run(
    job: Path = typer.Argument(..., help="The job file, such as jobs/demo.yaml."),
    cell: str | None = typer.Option(None, help="The cell to use instead of the job's own."),
    body: str | None = typer.Option(None, help="The body's number; a new one every run unless "
                                               "given."),
    logs: Path = typer.Option(Path("logs"), help="Where recording, seal and report go."),
    speed: float = typer.Option(1.0, min=0.01, max=100.0, help="Run a simulated cell this many "
                                                                "times faster than real time."),
    truth: Path | None = typer.Option(None, help="After the run, write what the simulator knows "
                                                 "to this file (simulated cells only)."),
    live: bool = typer.Option(False, "--live", help="Show the run in a viewer that listens on this "
                                                    "machine: `cell view --live`."),
    part_temperature: float | None = typer.Option(
        None, min=-40.0, max=80.0, help="The body's temperature in degrees C, where the job scales "
                                        "to 20; the job's own unless given."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object on standard "
                                                       "output."),
) -> None:
    """Measure one body: drive to every hole, look, judge, record, report.

    Leaves a recording (`.rrd`), its seal and a report (`.html`) in the logs folder. Everything that
    can be known before the robot moves is checked before it moves: see `cell check`.

    Exit code: 0 all in tolerance, 1 out of tolerance or a hole not measured, 2 bad input, 3 device
    fault, 4 recording failed, 130 interrupted.
    """
    from cell.programs.run import Request, run_job

    with _Progress() as progress:
        request = Request(job, cell, body, logs, speed, truth, part_temperature, live)
        finished = run_job(request, progress.advance)
    if as_json:
        print_json(_as_json(finished))
    else:
        _print_table(finished)
    raise typer.Exit(_exit_code(finished))


def _exit_code(finished: Finished) -> int:
    if finished.status == "interrupted":
        return INTERRUPTED
    return IN_TOLERANCE if finished.result.verdict == "in_tolerance" else OUT_OF_TOLERANCE


class _Progress:
    """Hole n of N and the time left, on standard error."""

    def __init__(self) -> None:
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        self._bar = Progress(TextColumn("[bold]{task.description:<28}"), BarColumn(),
                             MofNCompleteColumn(), TextColumn("holes, time left"),
                             TimeRemainingColumn(), console=console, transient=True,
                             disable=not console.is_terminal)
        self._task = self._bar.add_task("checking the way", total=None)

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def advance(self, done: int, total: int, words: str) -> None:
        """Show that `done` of `total` holes are through, and what happens now."""
        self._bar.update(self._task, completed=done, total=total, description=words)


def _as_json(finished: Finished) -> dict[str, Any]:
    return {"body": finished.body_id, "verdict": finished.result.verdict,
            "status": finished.status, "log": str(finished.log), "report": str(finished.report),
            "features": [_feature_as_json(feature) for feature in finished.result.features],
            "alignment": finished.result.alignment}


def _feature_as_json(feature: Feature) -> dict[str, Any]:
    def by_axis(values: dict[str, float] | None) -> dict[str, float | None] | None:
        return None if values is None else {axis: values.get(axis) for axis in "xyzd"}

    return {"id": feature.id, "verdict": feature.verdict, "reason": feature.reason,
            "measured_mm": by_axis(feature.measured), "nominal_mm": by_axis(feature.nominal),
            "deviation_mm": by_axis(feature.deviation),
            "uncertainty_mm": by_axis(feature.uncertainty),
            "true_position_mm": feature.true_position, "in_plane_mm": feature.in_plane,
            "along_normal_mm": feature.along_normal}


def _print_table(finished: Finished) -> None:
    table = Table(title=f"Body {finished.body_id}", title_justify="left", header_style="bold",
                  caption="mm; U: the largest expanded uncertainty (k = 2); pos.: true position",
                  caption_justify="left")
    table.add_column("hole", no_wrap=True)
    table.add_column("verdict")
    for name in ("dx", "dy", "dz", "dd", "U", "pos."):
        table.add_column(name, justify="right", no_wrap=True)
    for feature in finished.result.features:
        table.add_row(feature.id, _words(feature), *_deviations(feature), _largest_u(feature),
                      _millimetres(feature.true_position))
    answers.print(table)
    answers.print(_summary(finished.result), highlight=False)
    answers.print(f"recording {finished.log}\nreport    {finished.report}", highlight=False,
                  soft_wrap=True)


def _words(feature: Feature) -> str:
    words = feature.verdict.replace("_", " ")
    reason = f" ({feature.reason})" if feature.reason else ""
    return f"[{COLOURS[feature.verdict]}]{words}[/]{reason}"


def _deviations(feature: Feature) -> list[str]:
    def one(axis: str) -> str:
        value = (feature.deviation or {}).get(axis)
        out = feature.axis_verdicts.get(axis) == "out_of_tolerance"
        text = "·" if value is None else f"{value:+.3f}"
        return f"[red bold]{text}[/]" if out else text

    return [one(axis) for axis in "xyzd"]


def _largest_u(feature: Feature) -> str:
    return "·" if feature.uncertainty is None else f"{2 * max(feature.uncertainty.values()):.3f}"


def _millimetres(value: float | None) -> str:
    return "·" if value is None else f"{value:.3f}"


def _summary(result: BodyResult) -> str:
    verdicts = [feature.verdict for feature in result.features]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict.replace('_', ' ')}"
                       for verdict in dict.fromkeys(verdicts))
    return f"[bold {COLOURS[result.verdict]}]{result.verdict.replace('_', ' ')}[/]: {counts}"
