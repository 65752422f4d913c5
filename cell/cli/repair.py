"""`cell repair`: what a killed run left."""

from __future__ import annotations

from pathlib import Path

import typer

from cell.cli.words import answers, print_json


def repair(
    log: Path = typer.Argument(..., metavar="LOG", help="A recording whose run died."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Copy what is whole of a torn recording, and seal the copy as *repaired*.

    A run that was killed, a disk that was full, a copy that broke off: every hole up to the last
    whole one is kept, in `<log>.repaired.rrd` beside the original, which stays as it is. The seal
    names the original by its hash.

    Exit code: 0 repaired, 2 nothing to repair, altered or unreadable, 4 the copy cannot be written.
    """
    from cell.recording.guard import guarded
    from cell.recording.repair import repair as repair_log

    seal = guarded(repair_log, log)
    copy = log.with_name(seal.file)
    if as_json:
        print_json({"ok": True, "log": str(copy), "holes": seal.holes, "chain": seal.chain})
    else:
        answers.print(f"{copy}: {seal.holes} whole holes, sealed as repaired", highlight=False,
                      soft_wrap=True)
