"""`cell view`: look at a recording."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import typer

from cell.cli.words import console
from cell.core.errors import DocumentError


def view(
    log: Path | None = typer.Argument(None, metavar="LOG", help="A recording (.rrd)."),
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
    `--web` is served from this machine, but a browser with access to the internet lets it ask for
    news: open it in one without, or block them there.

    A torn recording is shown up to its last whole hole. Ctrl-C ends it.

    Exit code: 0 closed, 2 unreadable or no such hole, 3 no viewer or no screen.
    """
    from cell.recording.guard import guarded
    from cell.recording.replay import find_hole, photograph, serve, show, wait_for_run

    if live:
        return wait_for_run(_tell if web else None)
    if log is None:
        raise DocumentError("expected a recording, or --live", place="LOG")
    number = guarded(partial(find_hole, hole_id=hole), log)
    if picture is not None:
        picture.write_bytes(photograph(log, number).png)
    elif web:
        serve(log, _tell)
    else:
        show(log, number)
    return None


def _tell(address: str) -> None:
    console.print(f"open {address}\nCtrl-C ends it", highlight=False, soft_wrap=True)
