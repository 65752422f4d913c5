"""`cell audit`: does a recording hold?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from cell.cli.audit_words import as_json, print_audit, print_change, print_fault, print_row
from cell.cli.words import console, print_json

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from cell.programs.audit.folder import FolderAudit
    from cell.programs.audit.question import Question
    from cell.programs.audit.report import LogAudit

NOT_INTACT = 2


def audit(
    logs: list[Path] = typer.Argument(..., metavar="LOG…", help="Recordings (.rrd), or folders of "
                                                                "them."),
    strict: bool = typer.Option(False, help="Ask for every bit: what is reproduced only within "
                                            "0.01 of its uncertainty counts as different."),
    unsealed: bool = typer.Option(False, help="Audit it all the same where the seal is missing or "
                                              "does not fit; the hash chain inside still counts."),
    key: list[Path] = typer.Option([], metavar="FILE", help="Public keys (.pub): a seal must be "
                                                            "signed by one of them."),
    calibration: str = typer.Option(None, metavar="SET", help="What if it had been measured with "
                                                              "this calibration set?"),
    job: Path = typer.Option(None, metavar="FILE", help="What if it had been judged by this job "
                                                        "and its nominals?"),
    method: str = typer.Option(None, metavar="two-step|joint", help="What if it had been measured "
                                                                    "by this method?"),
    since: str = typer.Option(None, metavar="DAY", help="Only bodies since then: 2026-11-16, or "
                                                        "monday."),
    workers: int = typer.Option(1, min=1, metavar="N", help="Use N processes."),
    cluster: str = typer.Option(None, metavar="ADDRESS", help="Use a dask cluster (extra `dask`)."),
    save: bool = typer.Option(False, help="Save a picture beside it, LOG.audit.rrd: both results "
                                          "over the same images where they differ."),
    json_wanted: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Audit recordings: check that they are intact and compute every number again.

    Reads nothing but the recording: job, nominals, calibration, poses and images are all in it.
    Every number comes out *identical* (bit for bit), *reproduced* (within 0.01 of its standard
    uncertainty, verdict unchanged; other versions or another processor) or it *differs*.
    A folder is checked as a row: missing, reordered, duplicated and foreign recordings are named.

    With `--calibration`, `--job` or `--method` it answers a what-if instead, and exits with 1 where
    a verdict would change.

    The recordings are tamper-evident: it shows who changed what after the seal, not who held the
    key, nor that the newest bodies were removed (compare the newest head with one kept elsewhere).

    Exit code: 0 identical or reproduced, 1 something differs, 2 unreadable or not intact. Under a
    what-if: 0 all verdicts stay, 1 one changes. With 4 (a picture could not be saved) and 70 (a
    fault of the program) the audit itself failed: it says nothing of that recording.
    """
    from cell.programs.audit.gather import gather_logs, parse_since, read_what_if, started_since
    from cell.programs.audit.question import Question
    from cell.recording.keys import key_id, read_public_key

    question = Question(unsealed, tuple(key_id(read_public_key(path)) for path in key),
                        read_what_if(calibration, job, method), save)
    found, folders = gather_logs(logs)
    if since is not None:
        found = started_since(found, parse_since(since, datetime.now().astimezone()))
    audits, say = [], print_change if len(found) > 1 and question.what_if.asks else print_audit
    for each in _audit_with_progress(found, question, workers, cluster):
        audits.append(each)
        print_fault(each)
        if not json_wanted:
            say(each)
    code = _exit_code(audits, folders, strict)
    if json_wanted:
        print_json(as_json(audits, folders, code))
    else:
        print_row(audits, folders)
    raise typer.Exit(code)


def _audit_with_progress(logs: Sequence[Path], question: Question, workers: int,
                         cluster_address: str | None) -> Iterator[LogAudit]:
    from rich.progress import Progress

    from cell.programs.audit.spread import audit_each, cluster
    from cell.recording.guard import processes

    with ExitStack() as stack:
        executor: Executor | None = None
        if cluster_address is not None:
            executor = stack.enter_context(cluster(cluster_address))
        elif workers > 1 or question.unsealed:  # what no seal vouches for may take a process down
            executor = stack.enter_context(processes(workers))
        bar = stack.enter_context(Progress(console=console, transient=True,
                                           disable=not console.is_terminal))
        task = bar.add_task("auditing", total=len(logs))
        for each in audit_each(logs, question, executor,
                               lambda holes: bar.update(task, description=f"hole {holes}")):
            bar.advance(task)
            yield each


def _exit_code(audits: Sequence[LogAudit], folders: Sequence[FolderAudit], strict: bool) -> int:
    """Take the worst: what failed before what is not intact, that before what differs."""
    codes = [each.exit_code(strict) for each in audits]
    return max(codes + [NOT_INTACT for folder in folders if folder.findings])
