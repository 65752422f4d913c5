"""`cell results`: list, show, export and rebuild the results database."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import typer

from cell.cli.words import answers, console, print_json
from cell.core.documents.result import BodyVerdict
from cell.core.errors import OUT_OF_TOLERANCE, DocumentError

if TYPE_CHECKING:
    from cell.results.query import Filter

results_app = typer.Typer(
    name="results", no_args_is_help=True,
    help="""The results of all bodies: list, show, follow a trend, export CSV, rebuild.

Ends with 2 where no body matches what is asked for.""")

LOGS = typer.Option(Path("logs"), "--logs", help="The folder of recordings and of the database.")
URL = typer.Option(None, "--database", help="A plant's database, postgresql+psycopg://host/name.")
SINCE = typer.Option(None, "--since", formats=["%Y-%m-%d", "%Y-%m-%dT%H:%M"], help="From, in UTC.")
UNTIL = typer.Option(None, "--until", formats=["%Y-%m-%d", "%Y-%m-%dT%H:%M"], help="Up to, in UTC.")
JOB = typer.Option("", "--job", help="Only this job's bodies.")
VERDICTS = get_args(BodyVerdict)
VERDICT = typer.Option("", "--verdict", help=f"{', '.join(VERDICTS)}.")
PRODUCTION = typer.Option(False, "--production", help="Without trials.")
LAST = typer.Option(None, "--last", min=1, help="Only the last so many.")
JSON = typer.Option(False, "--json", help="Print one JSON object.")


@results_app.command("list")
def list_results(logs: Path = LOGS, database: str | None = URL, since: datetime | None = SINCE,
                 until: datetime | None = UNTIL, job: str = JOB, verdict: str = VERDICT,
                 production: bool = PRODUCTION, last: int | None = LAST,
                 as_json: bool = JSON) -> None:
    """List bodies, the latest first."""
    from cell.programs.results import count_unbooked, opened, refuse_nothing
    from cell.results.query import list_bodies

    wanted = _filter(since, until, job, verdict, production, last)
    with opened(logs, database) as found:
        if unbooked := 0 if database else count_unbooked(found, logs):
            console.print(f"{unbooked} recordings here are not in the database yet: "
                          "`cell results rebuild` takes them in", highlight=False, soft_wrap=True)
        refuse_nothing(found, wanted)
        rows = list_bodies(found, wanted)
    if as_json:
        print_json({"bodies": rows})
    else:
        _print_bodies(rows)


@results_app.command("show")
def show_results(body: str = typer.Argument(..., help="A body's number or a recording's id."),
                 logs: Path = LOGS, database: str | None = URL, as_json: bool = JSON) -> None:
    """Show every axis of one body."""
    from cell.programs.results import opened
    from cell.results.query import show_body

    with opened(logs, database) as found:
        shown = show_body(found, body)
    if shown is None:
        raise DocumentError(f"there is no body or recording {body!r} in the database")
    if as_json:
        print_json({"body": shown[0], "axes": shown[1]})
    else:
        _print_bodies([shown[0]])
        _print_axes(shown[1])


@results_app.command("trend")
def show_trend(feature: str, axis: str, logs: Path = LOGS, database: str | None = URL,
               since: datetime | None = SINCE, until: datetime | None = UNTIL,
               production: bool = PRODUCTION, last: int | None = LAST,
               as_json: bool = JSON) -> None:
    """Follow the deviation of one axis of one feature over the bodies."""
    from cell.programs.results import opened, utc
    from cell.results.query import trend

    with opened(logs, database) as found:
        points = trend(found, feature, axis, _filter(since, until, "", "", production, last))
    if not points:
        raise DocumentError(f"no body that is asked for has an axis {axis!r} of a feature "
                            f"{feature!r}")
    if as_json:
        print_json({"feature": feature, "axis": axis, "points": [vars(point) for point in points]})
        return
    for point in points:
        answers.print(f"{utc(point.started)}  {point.body_id:<24} {_number(point.deviation)} "
                      f"± {_number(point.uncertainty)}  {point.verdict or ''}", highlight=False)


@results_app.command("export")
def export_results(to: Path = typer.Argument(..., help="The CSV file; - writes to the terminal."),
                   logs: Path = LOGS, database: str | None = URL, since: datetime | None = SINCE,
                   until: datetime | None = UNTIL, job: str = JOB, verdict: str = VERDICT,
                   production: bool = PRODUCTION, last: int | None = LAST) -> None:
    """Export every axis of the bodies as CSV, one line an axis."""
    from cell.programs.results import opened, refuse_nothing, write_csv
    from cell.results.query import export_rows

    wanted = _filter(since, until, job, verdict, production, last)
    with opened(logs, database) as found:
        refuse_nothing(found, wanted)
        if str(to) == "-":
            count = write_csv(export_rows(found, wanted), sys.stdout)
        else:
            try:
                with to.open("w", newline="", encoding="utf-8") as stream:
                    count = write_csv(export_rows(found, wanted), stream)
            except OSError as error:
                raise DocumentError(f"cannot be written: {error.strerror}",
                                    source=str(to)) from error
    console.print(f"{count} lines")


@results_app.command("rebuild")
def rebuild_results(logs: Path = LOGS, database: str | None = URL, as_json: bool = JSON) -> None:
    """Make the rows of all recordings again, also after a change of the schema. Approvals, visits,
    faults and bypasses stay as they are.
    """
    from rich.progress import Progress

    from cell.programs.results import opened, rebuild

    with opened(logs, database, any_schema=True) as found, \
            Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("recordings", total=None)
        troubles = rebuild(found, logs, lambda done, of: progress.update(task, completed=done,
                                                                         total=of))
    if as_json:
        print_json({"ok": not troubles, "not_read": troubles})
    for trouble in troubles:
        console.print(f"not read: {trouble}", highlight=False)
    raise typer.Exit(OUT_OF_TOLERANCE if troubles else 0)


def _filter(since: datetime | None, until: datetime | None, job: str, verdict: str,
            production: bool, last: int | None) -> Filter:
    from cell.results.query import Filter

    if verdict not in ("", *VERDICTS):
        raise DocumentError(f"expected {', '.join(VERDICTS)}; came {verdict!r}", place="--verdict")
    return Filter(_seconds(since), _seconds(until), job, verdict, production_only=production,
                  last=last)


def _seconds(moment: datetime | None) -> float | None:
    return None if moment is None else moment.replace(tzinfo=UTC).timestamp()


def _print_bodies(rows: list[dict[str, Any]]) -> None:
    from cell.programs.results import utc

    _print_columns([("started", "body", "job", "verdict", "measured", "out", "missing", "worst mm",
                     "")] + [
        (utc(row["started"]), row["body_id"], row["job"], row["verdict"].replace("_", " "),
         str(row["measured"]), str(row["out_of_tolerance"]), str(row["missing"]),
         _number(row["worst"]), _remarks(row)) for row in rows])


def _remarks(row: dict[str, Any]) -> str:
    status = row["status"] if row["status"] != "complete" else ""
    return " ".join(word for word in ("TRIAL" if row["trial"] else "", status) if word)


def _print_axes(rows: list[dict[str, Any]]) -> None:
    numbers = ("nominal", "measured", "deviation", "tolerance", "uncertainty")
    _print_columns([("hole", "axis", *numbers[:4], "u (k=1)", "verdict")] + [
        (row["feature"], row["axis"] or "", *(_number(row[name]) for name in numbers),
         row["reason"] or (row["verdict"] or "").replace("_", " ")) for row in rows])


def _print_columns(rows: list[tuple[str, ...]]) -> None:
    """Print rows below each other, columns as wide as their widest entry; nothing is cut off."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        answers.print(line.rstrip(), highlight=False, soft_wrap=True, markup=False)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
