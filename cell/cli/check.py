"""`cell check`: everything that can be known of a job before anything moves."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.markup import escape
from rich.table import Table

from cell.cli.words import answers, console, print_json
from cell.core.errors import DocumentError

if TYPE_CHECKING:
    from cell.programs.check import CheckedJob, CheckedStop


def check(
    job: Path | None = typer.Argument(None, help="The job's file."),
    cell: str | None = typer.Option(None, help="Measure on this cell instead of the job's own."),
    logs: Path = typer.Option(Path("logs"), help="Where recordings will be written."),
    schema: bool = typer.Option(False, "--schema", help="Print the JSON schema of job files, for "
                                                        "editors, and leave."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object on standard output."),
) -> None:
    """Check a job: its documents, every stop, and the whole way. Nothing moves.

    Reads the job, its nominals and the cell's calibration, plans every stop, and drives the way in
    the mind: joint limits, reach, workspace, singularities, and the sensor against the keep-out
    boxes. (The arm itself is not checked against them.) Exit code 0: the job can run; 2: it cannot,
    and why.

    To have job files completed by an editor, save the output of `cell check --schema` and name it
    in the first line of a job: `# yaml-language-server: $schema=job.schema.json`.
    """
    if schema:
        _print_schema()
    elif job is None:
        raise DocumentError("which job? name its file, for example: cell check jobs/demo.yaml")
    else:
        _check(job, cell, logs, as_json)


def _print_schema() -> None:
    from cell.core.documents.job import JobDocument

    answers.print(json.dumps(JobDocument.model_json_schema(), indent=1), soft_wrap=True,
                  markup=False, highlight=False)


def _check(job: Path, cell: str | None, logs: Path, as_json: bool) -> None:
    from cell.programs.check import check_job

    checked = check_job(job, cell, logs)
    if as_json:
        print_json(_describe(checked))
    else:
        _show(checked)
    if checked.plan.refusals:
        raise typer.Exit(DocumentError.exit_code)


def _describe(checked: CheckedJob) -> dict[str, Any]:
    papers = checked.papers
    return {"ok": not checked.plan.refusals, "job": papers.job.name, "cell": papers.station.name,
            "set": papers.set_id, "holes": len(papers.holes), "station_time_s": checked.seconds,
            "stops": [_describe_stop(stop) for stop in checked.stops],
            "refusals": [{"stop": stop, "reason": reason}
                         for stop, reason in checked.plan.refusals],
            "not_visited": list(checked.not_visited),
            "stale_offsets": dict(checked.stale_offsets)}


def _describe_stop(checked: CheckedStop) -> dict[str, Any]:
    stop = checked.stop
    return {"hole": stop.hole.id, "taught": stop.taught,
            "joints_deg": [math.degrees(angle) for angle in stop.joints],
            "base_from_flange": stop.base_from_flange.matrix.tolist(),
            "clearance_mm": checked.clearance if math.isfinite(checked.clearance) else None,
            "obstacle": checked.obstacle or None, "singularity_deg": checked.singularity_deg,
            "joint_limit_deg": checked.limit_deg, "motion_s": checked.seconds}


def _show(checked: CheckedJob) -> None:
    papers, refusals = checked.papers, checked.plan.refusals
    table = Table("stop", "pose", "clearance mm", "nearest", "singular °", "limit °",
                  "motion s", title=f"{papers.job.name} on {papers.station.name}, "
                                    f"calibration set {papers.set_id}")
    for row in checked.stops:
        table.add_row(row.stop.hole.id, "taught" if row.stop.taught else "computed",
                      f"{row.clearance:.0f}" if row.obstacle else "·", row.obstacle,
                      f"{row.singularity_deg:.0f}", f"{row.limit_deg:.0f}", f"{row.seconds:.1f}")
    answers.print(table)
    if checked.not_visited:
        console.print("[yellow]no stop for:[/yellow] " + ", ".join(checked.not_visited),
                      highlight=False, soft_wrap=True)
    for offset, reason in checked.stale_offsets.items():
        console.print(f"[yellow]the CMM offset of {offset} will not be applied:[/yellow] {reason}")
    for stop, reason in refusals:
        console.print(f"[red]refused:[/red] stop {stop}: {escape(reason)}", highlight=False,
                      soft_wrap=True)
    if not refusals:
        answers.print(f"The job can run: {len(checked.stops)} stops, some {checked.seconds:.0f} s.")
