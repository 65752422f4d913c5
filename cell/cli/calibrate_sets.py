"""`cell calibrate history|diff|activate|rollback`: the sets of a cell."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import typer
from rich.table import Table

from cell.cli.words import answers, print_json, user_name

CELL = typer.Option("demo", "--cell", help="The cell, a folder of calibration/.")
FOLDER = typer.Option(Path("calibration"), "--calibration", help="Where the cells' folders lie.")
JSON = typer.Option(False, "--json", help="Print one JSON object.")
REASON = typer.Option("", "--reason", help="Why, for the history.")
BY = typer.Option("", "--by", help="Who; the logged-in user unless given.")


def history(cell: str = CELL, calibration: Path = FOLDER, as_json: bool = JSON) -> None:
    """List every activation of a cell's sets, oldest first.

    Exit code: 0, or 2 where a paper is wrong.
    """
    from cell.archive import activation
    from cell.archive.sets import cell_folder

    rows = activation.history(cell_folder(calibration, cell))
    if as_json:
        print_json({"cell": cell, "history": [row.model_dump() for row in rows]})
        return
    table = Table("set", "since", "by", "reason", "before it", box=None, pad_edge=False)
    for row in rows:
        table.add_row(row.set, row.at, row.by, row.reason, row.previous or "")
    answers.print(table)


def activate(set_id: str = typer.Argument(..., metavar="SET"), cell: str = CELL,
             calibration: Path = FOLDER, by: str = BY, reason: str = REASON) -> None:
    """Make a set the one that the cell measures with, in one step.

    Exit code: 0, or 2 where there is no such set, or it is not intact.
    """
    from cell.archive import activation
    from cell.archive.sets import cell_folder

    active = activation.activate(cell_folder(calibration, cell), set_id, by=by or user_name(),
                                 at=_now(), reason=reason)
    answers.print(f"active: {active.set}, before it {active.previous}", highlight=False)


def rollback(set_id: str | None = typer.Argument(None, metavar="[SET]"), cell: str = CELL,
             calibration: Path = FOLDER, by: str = BY, reason: str = REASON) -> None:
    """Go back to an earlier set, the one before unless named.

    Exit code: 0, or 2 where there is none, or robot or sensor have been exchanged since.
    """
    from cell.archive import activation
    from cell.archive.sets import cell_folder

    active = activation.rollback(cell_folder(calibration, cell), set_id,
                                 by=by or user_name(), at=_now(), reason=reason)
    answers.print(f"active: {active.set}, before it {active.previous}", highlight=False)


def diff(first: str = typer.Argument(..., metavar="A"),
         second: str = typer.Argument(..., metavar="B"), cell: str = CELL,
         calibration: Path = FOLDER, as_json: bool = JSON) -> None:
    """Say what changed from set A to set B, as a measured point at the working distance sees it.

    Exit code: 0, or 2 where a set is absent or not intact.
    """
    from cell.archive.sets import cell_folder
    from cell.programs.calibration.compare_sets import compare_sets

    changes = compare_sets(cell_folder(calibration, cell), first, second)
    if as_json:
        print_json({"first": first, "second": second,
                    "changes": {change.name: change.value for change in changes}})
        return
    table = Table("what", "changed by", "", box=None, pad_edge=False)
    for change in changes:
        table.add_row(change.meaning, f"{change.value:.4f}", change.unit)
    answers.print(table)


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
