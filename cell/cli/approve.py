"""`cell approve`: let a job and its calibration give production results."""

from __future__ import annotations

from pathlib import Path

import typer

from cell.cli.words import answers, print_json


def approve(job: Path = typer.Argument(..., help="The job's file, jobs/JOB.yaml."),
            by: str = typer.Option("", "--by", help="Who approves."),
            cell: str | None = typer.Option(None, "--cell", help="Which cell; else the job's."),
            note: str = typer.Option("", "--note", help="Why, or on what evidence."),
            withdraw: bool = typer.Option(False, "--withdraw", help="Take the approval back."),
            logs: Path = typer.Option(Path("logs"), "--logs", help="Where the database lies."),
            as_json: bool = typer.Option(False, "--json", help="Print one JSON object.")) -> None:
    """Approve a job, its calibration set and its cell, by their hashes, with who and when.

    A shift with papers that are not approved runs, and everything it measures is marked TRIAL.
    """
    from cell.archive.logs import check_logs
    from cell.programs.approve import approve_job, withdraw_job
    from cell.programs.results import opened, utc

    check_logs(logs)
    with opened(logs) as database:
        if withdraw:
            count = withdraw_job(database, job, cell)
            answer: dict[str, object] = {"ok": True, "withdrawn": count}
            said = [f"{count} approval withdrawn"]
        else:
            rows = approve_job(database, job, by, cell, note)
            answer = {"ok": True, "approved": rows}
            said = [f"{row['kind']:<12} {row['name']:<24} {row['hash'][:16]}  "
                    f"{row['approved_by']}, {utc(row['approved_at'])}" for row in rows]
    if as_json:
        print_json(answer)
    else:
        answers.print("\n".join(said), highlight=False, soft_wrap=True)
