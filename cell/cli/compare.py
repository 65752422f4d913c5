"""`cell compare`: measured points against nominals, by point and axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.table import Table

from cell.cli.words import answers, print_json

if TYPE_CHECKING:
    from cell.metrology.judge.compare import Comparison, Statistics

CHANCE = 0.05  # a bias that chance would give more rarely is one


def compare(
    measured: Path = typer.Argument(..., help="CSV with `id,x,y,z` and optionally `d`, in mm. An "
                                              "id that stands again was measured again."),
    nominals: Path = typer.Argument(..., help="CSV with `id,x,y,z` and optionally `control`, in "
                                              "mm. A job's nominals will do."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object on standard output."),
) -> None:
    """Compare measured points with nominals: deviations, bias, spread and maximum by axis.

    An empty cell, or an axis that `control` does not list, is not controlled and never counted as
    zero. The tables of the paper are in `jobs/paper`:

    `cell compare jobs/paper/table2_measured.csv jobs/paper/table2_nominals.csv`
    """
    from cell.archive.files import read_text
    from cell.core.documents.points import read_measured_points, read_nominal_points
    from cell.metrology.judge.compare import compare_points

    comparison = compare_points(read_measured_points(read_text(measured), str(measured)),
                                read_nominal_points(read_text(nominals), str(nominals)),
                                str(measured))
    if as_json:
        print_json(_describe(comparison))
    else:
        _show(comparison)


def _describe(comparison: Comparison) -> dict[str, Any]:
    axes = list(comparison.axes)
    return {"ok": True,
            "points": [{"id": point.id,
                        "deviation_mm": {axis: point.values.get(axis) for axis in axes}}
                       for point in comparison.points],
            "axes": {axis: _describe_axis(found) for axis, found in comparison.axes.items()},
            "repeatability": [{"id": name, "n": n, "sd_mm": spread}
                              for name, (n, spread) in comparison.repeatability.items()],
            "missing": comparison.missing}


def _describe_axis(found: Statistics) -> dict[str, Any]:
    return {"n": found.n, "mean_mm": found.mean, "sd_mm": found.sd, "rms_mm": found.rms,
            "max_mm": found.max, "max_id": found.max_id, "t": found.t,
            "p": found.p}


def _show(comparison: Comparison) -> None:
    axes = list(comparison.axes)
    table = Table("id", *(f"d{axis} mm" for axis in axes), title="deviations: measured - nominal")
    for point in comparison.points:
        table.add_row(point.id, *(_signed(point.values.get(axis)) for axis in axes))
    answers.print(table)
    answers.print(_by_axis(comparison))
    for name, (n, spread) in comparison.repeatability.items():
        sds = ", ".join(f"{axis} {sd:.4f}" for axis, sd in spread.items())
        answers.print(f"{name} repeated {n} times: standard deviation {sds} mm")
    for axis, found in comparison.axes.items():
        if found.t is not None and found.p is not None and found.p < CHANCE:
            answers.print(f"{axis}: the bias of {found.mean:+.4f} mm is significant "
                          f"(t = {found.t:+.1f}, p = {found.p:.2g})")
    if comparison.missing:
        answers.print(f"not measured: {', '.join(comparison.missing)}")


def _by_axis(comparison: Comparison) -> Table:
    table = Table("axis", "n", "mean (bias)", "sd", "rms", "max", "at", title="by axis, mm")
    for axis, found in comparison.axes.items():
        table.add_row(axis, str(found.n), _signed(found.mean),
                      "" if found.sd is None else f"{found.sd:.4f}", f"{found.rms:.4f}",
                      f"{found.max:.4f}", found.max_id)
    return table


def _signed(value: float | None) -> str:
    return "" if value is None else f"{value:+.4f}"
