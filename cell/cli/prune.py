"""`cell prune`: keep the numbers, let the images go."""

from __future__ import annotations

from pathlib import Path

import typer

from cell.cli.words import answers, print_json


def prune(
    log: Path = typer.Argument(..., metavar="LOG", help="A sealed recording."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Copy a recording without its images, and seal the copy as *pruned*.

    Papers, poses, numbers and the hash of every image stay, so the chain still verifies; what
    cannot be done any more is to measure again. The original, which the seal names by its hash,
    is left alone: removing it is yours to do.

    Exit code: 0 pruned, 2 not intact or unreadable, 4 the copy cannot be written.
    """
    from cell.recording.prune import prune as prune_log

    seal = prune_log(log)
    copy = log.with_name(seal.file)
    if as_json:
        print_json({"ok": True, "log": str(copy), "bytes": seal.size, "chain": seal.chain})
    else:
        answers.print(f"{copy}: {seal.size / 1e6:.1f} MB, sealed as pruned", highlight=False,
                      soft_wrap=True)
