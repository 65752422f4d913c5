"""`cell report`: the report of a body, made again from its recording."""

from __future__ import annotations

from pathlib import Path

import typer

from cell.cli.words import answers


def report(
    log: Path = typer.Argument(..., help="The recording (.rrd) of a body, or a folder: "
                                         "its newest."),
    output: Path | None = typer.Option(None, help="Where to write the page; beside the recording "
                                                  "unless given."),
) -> None:
    """Write the report of a recorded body: one HTML page that needs no network.

    `cell run` writes it too. A recording of a run that died is reported as far as it goes.
    """
    from cell.archive.logs import choose_log
    from cell.programs.report import report_log

    answers.print(report_log(choose_log(log), output), soft_wrap=True, highlight=False)
