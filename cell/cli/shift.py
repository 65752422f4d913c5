"""`cell shift`: bodies after bodies."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cell.cli.keys import Keys
from cell.cli.words import answers, console, print_json
from cell.core.errors import INTERRUPTED

if TYPE_CHECKING:
    from cell.programs.shift.board import Board

NOT_BOOKED = 4

def shift(file: Path | None = typer.Argument(None, help="The shift's file, jobs/SHIFT.yaml."),
          simulate: bool = typer.Option(False, "--simulate", help="A virtual line brings virtual "
                                        "bodies; simulated cells only."),
          bodies: int | None = typer.Option(None, "--bodies", min=1, help="End after so many."),
          speed: float = typer.Option(1.0, "--speed", min=0.01, max=100.0, help="How much "
                                      "faster than real time; simulated cells only."),
          logs: Path = typer.Option(Path("logs"), "--logs", help="Where recordings and results "
                                    "lie."),
          live: bool = typer.Option(False, "--live", help="Show every body in a viewer on this "
                                    "machine: `cell view --live`."),
          report: bool = typer.Option(False, "--report", help="Only write the report of the last "
                                      "shift of this file, running or not."),
          registers: bool = typer.Option(False, "--registers", help="Print the Modbus register "
                                         "map."),
          as_json: bool = typer.Option(False, "--json", help="Print one JSON object.")) -> None:
    """Run a shift: bodies come by the line, are measured, judged and released.

    Runs until the line says stop, `q` is typed, or Ctrl-C is pressed. What a killed shift left is
    answered first when it is started again. Only papers approved by `cell approve` give production
    results; all else is marked TRIAL. At the end a report lies in the logs folder.

    Exit code: 0 the shift ended as told, 2 bad input, 3 a device could not be opened, 4 the results
    could not be written, 130 interrupted.
    """
    if registers:
        _print_registers()
        return
    if file is None:
        raise typer.BadParameter("which shift? give its file", param_hint="FILE")
    if report:
        answer, code = _report_only(file, logs), 0
    else:
        answer, code = _run(file, logs, simulate=simulate, bodies=bodies, speed=speed, live=live)
    if as_json:
        print_json(answer)
    else:
        answers.print("\n".join(f"{key:<12} {value}" for key, value in answer.items()),
                      highlight=False, soft_wrap=True)
    raise typer.Exit(code)


def _run(file: Path, logs: Path, **options: Any) -> tuple[dict[str, Any], int]:  # noqa: ANN401
    from cell.programs.shift.report import write_shift_report
    from cell.programs.shift.run import ShiftRequest, run_shift

    with Keys() as keys, _screen(keys) as show:
        done = run_shift(ShiftRequest(file, logs, typed=_typed(keys), **options), show, _tell)
    written = write_shift_report(logs, done.document, done.began, done.ended)
    answer = {"shift": done.document.name, "bodies": done.bodies, "booked": done.all_booked,
              "report": str(written.html), "csv": str(written.csv)}
    unbooked = 0 if done.all_booked else NOT_BOOKED
    return answer, INTERRUPTED if done.interrupted else unbooked


def _report_only(file: Path, logs: Path) -> dict[str, Any]:
    from cell.programs.shift.report import write_last_report

    written = write_last_report(logs, file)
    return {"report": str(written.html), "csv": str(written.csv)}


def _typed(keys: Keys) -> Iterable[str] | None:
    """The lines typed at the terminal: under a screen, which is redrawn, the screen shows them."""
    if not keys.here:
        return None
    return keys.lines() if console.is_terminal else sys.stdin


@contextmanager
def _screen(keys: Keys) -> Iterator[Callable[[Board], None]]:
    """Draw the board on a terminal; without one, say a line whenever it changes."""
    from rich.live import Live

    from cell.cli.shift_screen import draw, say
    from cell.programs.shift.board import Board

    if console.is_terminal:
        shown = [Board("")]
        with Live(get_renderable=lambda: draw(shown[0], keys.draft), console=console,
                  refresh_per_second=8):
            yield partial(shown.__setitem__, 0)
        return
    said = ""

    def tell(board: Board) -> None:
        nonlocal said
        if (line := say(board)) != said:
            said = line
            console.print(line, highlight=False, soft_wrap=True)
    yield tell


def _tell(words: str) -> None:
    console.print(words, highlight=False, soft_wrap=True)


def _print_registers() -> None:
    from cell.line import registers

    for title, table in (("PLC -> cell, holding registers (3, 6, 16)", registers.FROM_PLC),
                         ("cell -> PLC, input registers (4)", registers.FROM_CELL)):
        answers.print(f"\n{title}", style="bold", highlight=False, soft_wrap=True)
        for one in table:
            span = f"{one.address}" + (f"-{one.address + one.size - 1}" if one.size > 1 else "")
            answers.print(f"  {span:>6}  {one.name:<18}{one.meaning}", highlight=False,
                          soft_wrap=True)
    for name in ("COMMANDS", "STATUS", "STATES", "VERDICTS", "REFUSALS", "FAULTS"):
        codes = ", ".join(f"{code} {word}" for word, code in getattr(registers, name).items()
                          if word)
        answers.print(f"\n{name}: {codes}", highlight=False, soft_wrap=True)
