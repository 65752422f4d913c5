"""`cell view`: look at a recording."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.markup import escape

from cell.cli.words import console
from cell.core.errors import DocumentError, RecordingError


def view(
    log: Path | None = typer.Argument(None, metavar="LOG", help="A recording (.rrd), or a "
                                                                    "folder: its newest."),
    hole: str | None = typer.Option(None, metavar="ID", help="Open it at this hole."),
    web: bool = typer.Option(False, help="Serve it to a browser on this machine instead of opening "
                                         "a window."),
    live: bool = typer.Option(False, help="Instead of a recording, show what `cell run --live`, "
                                          "`cell shift --live` or `cell calibrate --live` does on "
                                          "this machine."),
    picture: Path | None = typer.Option(None, metavar="PNG", help="Save a picture of it and end; "
                                                                  "needs no screen."),
) -> None:
    """Open a recording in the viewer: images with what was found, the body, deviations, verdicts.

    Works offline. The viewer listens on 127.0.0.1 only and sends no usage data; the page of
    `--web` is served from this machine, and with a policy under which browsers let it talk to
    this machine alone.

    What is shown is drawn anew from the audited records. A torn recording is shown up to its last
    whole hole; what is not as it was sealed is said. Ctrl-C ends it.

    Exit code: 0 closed, 2 unreadable or no such hole, 3 no viewer or no screen, 4 the picture
    cannot be written.
    """
    from cell.archive.logs import choose_log
    from cell.recording.guard import guarded
    from cell.recording.replay import photograph, serve, show, survey, wait_for_run

    if live:
        return wait_for_run(_tell if web else None)
    if log is None:
        raise DocumentError("expected a recording, or --live", place="LOG")
    log = choose_log(log)
    found = guarded(survey, log)
    for warning in found.warnings:
        console.print(f"[yellow]{escape(warning)}[/]", highlight=False, soft_wrap=True)
    number = None if hole is None else found.find(hole)
    if picture is not None:
        _save(photograph(log, number or 0).png, picture)
    elif web:
        serve(log, number, _tell)
    else:
        show(log, number or 0)
    return None


def _save(png: bytes, picture: Path) -> None:
    try:
        picture.write_bytes(png)
    except OSError as error:
        raise RecordingError(f"{picture}: cannot be written: {error.strerror}") from None


def _tell(address: str) -> None:
    console.print(f"open {address}\nCtrl-C ends it", highlight=False, soft_wrap=True)
