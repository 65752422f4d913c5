"""What `cell audit` says: a few lines a recording, tables of what differs, all of it as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, TypeAlias

from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cell.cli.words import answers, console

if TYPE_CHECKING:
    from cell.programs.audit.compare import Difference
    from cell.programs.audit.folder import FolderAudit
    from cell.programs.audit.report import Change, LogAudit

Json: TypeAlias = Any

COLOURS = {"identical": "green", "reproduced": "green", "differs": "red", "refused": "red",
           "failed": "red", "stays": "green", "changes": "red"}
MANY = {"differs": "differ", "stays": "stay", "changes": "change"}
MARKS = {True: "[green]yes[/]", False: "[red]no [/]", None: "[yellow]–  [/]"}
WIDE = 120  # characters
MOST = 24  # rows of a table; all are in the JSON


def print_audit(audit: LogAudit) -> None:
    """Print what came of one recording."""
    answers.print(f"[bold]{escape(audit.log.name)}[/]  [{COLOURS[audit.answer]}]{audit.answer}[/]"
                  f"  {_origin(audit)}", highlight=False, soft_wrap=True)
    if audit.problem is not None:
        answers.print(f"  [red]{escape(audit.problem)}[/]", highlight=False, soft_wrap=True)
    for check in audit.checks:
        answers.print(f"  {MARKS[check.passed]} {check.level:<10} {escape(check.words)}",
                      highlight=False, soft_wrap=True)
    for line in _lines(audit):
        answers.print(f"  {line}", highlight=False, soft_wrap=True)
    if audit.differences:
        _print_table(_differences(audit))
    if audit.changes:
        _print_table(_changes(audit.changes))


def print_fault(audit: LogAudit) -> None:
    """Print where the program failed over one recording, for whoever mends it."""
    if audit.traceback:
        console.print(f"{audit.log}: a fault of the program, not of your input\n{audit.traceback}",
                      markup=False, highlight=False, soft_wrap=True, style="red")


def print_change(audit: LogAudit) -> None:
    """Print one line on one recording under a what-if, or all of it where it was refused."""
    if audit.problem is not None:
        return print_audit(audit)
    began = datetime.fromtimestamp(audit.started, UTC)
    answers.print(f"{escape(audit.body_id):<24} {began:%Y-%m-%d %H:%M} UTC  "
                  f"[{COLOURS[audit.answer]}]{audit.answer:<7}[/]  "
                  f"{_plain(audit.verdict)} -> {_plain(audit.verdict_then)}"
                  f"  {escape(', '.join(audit.turning))}{_skipped(audit)}",
                  highlight=False, soft_wrap=True)
    return None


def _print_table(table: Table) -> None:
    """Give a table the room that it needs where no screen sets a width."""
    (answers if answers.is_terminal else Console(width=WIDE)).print(table)


def print_row(audits: Sequence[LogAudit], folders: Sequence[FolderAudit]) -> None:
    """Print what came of all recordings together, and of the rows of folders."""
    if len(audits) != 1:
        counts = Counter[str](audit.answer for audit in audits)
        words = [f"{counts[answer]} {answer if counts[answer] == 1 else MANY.get(answer, answer)}"
                 for answer in COLOURS if counts[answer]]
        answers.print(f"{len(audits)} recordings: {', '.join(words)}", highlight=False)
    for folder in folders:
        for finding in folder.findings:
            answers.print(f"[red]{finding.kind}[/] {escape(finding.file)}: "
                          f"{escape(finding.words)}", highlight=False, soft_wrap=True)
        if folder.head:
            answers.print(f"newest head {folder.head} ({folder.newest})\n"
                          "keep it elsewhere: it shows when the newest bodies are removed",
                          highlight=False, soft_wrap=True)


def as_json(audits: Sequence[LogAudit], folders: Sequence[FolderAudit], code: int
            ) -> dict[str, Any]:
    """Say it all as one object."""
    return {"ok": code == 0, "exit_code": code,
            "logs": [_log_as_json(audit) for audit in audits],
            "folders": [{"folder": str(row.folder), "newest": row.newest, "head": row.head,
                         "findings": [asdict(finding) for finding in row.findings]}
                        for row in folders]}


def _log_as_json(audit: LogAudit) -> dict[str, Any]:
    numbers = {level: audit.numbers[level] for level in ("identical", "reproduced", "differs")}
    changes = [{**asdict(change), "turns": change.turns} for change in audit.changes]
    said = asdict(audit) | {"log": str(audit.log), "answer": audit.answer, "numbers": numbers,
                            "changes": changes}
    return {name: _finite(value) for name, value in said.items() if name != "error_code"}


def _finite(value: Json) -> Json:
    """Say null where an altered recording holds no number: JSON knows neither NaN nor infinity."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    return [_finite(each) for each in value] if isinstance(value, list | tuple) else value


def _origin(audit: LogAudit) -> str:
    if not audit.started:
        return ""
    began = datetime.fromtimestamp(audit.started, UTC)
    return escape(f"body {audit.body_id}, {began:%Y-%m-%d %H:%M} UTC, {audit.status}")


def _lines(audit: LogAudit) -> list[str]:
    counts = [f"{audit.numbers[level]} {level}" for level in ("identical", "reproduced", "differs")
              if audit.numbers[level]]
    lines = [f"{sum(audit.numbers.values())} numbers of {audit.holes} holes: {', '.join(counts)}"
             ] if counts else []
    if audit.skipped:
        lines.append(_skipped(audit).strip())
    lines += [f"[yellow]{escape(warning)}[/]" for warning in audit.warnings]
    lines += [f"{name}: {escape(was)} then, {escape(here)} here"
              for name, (was, here) in audit.versions.items()]
    if audit.verdict_then is not None:
        lines.append(f"verdict {_plain(audit.verdict)}, {'would be' if audit.what_if else 'now'} "
                     f"{_plain(audit.verdict_then)}")
    return lines


def _skipped(audit: LogAudit) -> str:
    return (f"  [yellow]{audit.skipped} holes without their images: not measured again[/]"
            if audit.skipped else "")


def _differences(audit: LogAudit) -> Table:
    """Tabulate what differs; where nothing does, what came closest to it."""
    rows = sorted(audit.differences, key=lambda each: (each.level, -_share(each)))
    shown = [each for each in rows if each.level == "differs"] or rows[:5]
    table = Table(title="what differs" if audit.numbers["differs"] else "least well reproduced",
                  title_justify="left", header_style="bold", box=SIMPLE)
    for name in ("field", "recorded", "now", "difference", "limit"):
        table.add_column(name, justify="left" if name == "field" else "right")
    for each in shown[:MOST]:
        table.add_row(each.where, _short(each.recorded), _short(each.recomputed),
                      _number(each.difference), _number(each.limit))
    if len(shown) > MOST:
        table.add_row(f"and {len(shown) - MOST} more: --json has them")
    return table


def _share(difference: Difference) -> float:
    """How much of its limit a difference takes up."""
    if difference.difference is None or not difference.limit:
        return inf
    return difference.difference / difference.limit


def _short(words: str) -> str:
    try:
        return f"{float(words):.9g}"
    except ValueError:
        return words


def _changes(changes: Sequence[Change]) -> Table:
    table = Table(title="what if", title_justify="left", header_style="bold", box=SIMPLE)
    for name in ("hole", "verdict", "would be", "dx", "dy", "dz", "dd"):
        table.add_column(name, justify="right" if name.startswith("d") else "left")
    for change in changes:
        then = _plain(change.verdict_then)
        table.add_row(change.feature, _plain(change.verdict),
                      f"[red bold]{then}[/]" if change.turns else then,
                      *(_shift(change, axis) for axis in "xyzd"))
    return table


def _shift(change: Change, axis: str) -> str:
    was, then = change.deviation.get(axis), change.deviation_then.get(axis)
    if was is None or then is None:
        return "·"
    return f"{was:+.3f} {then - was:+.4f}"


def _plain(verdict: str | None) -> str:
    return "none" if verdict is None else verdict.replace("_", " ")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
