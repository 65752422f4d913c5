"""The command `cell`: its commands, and the one place where errors become exit codes."""

from __future__ import annotations

import signal
import sys
import time
import traceback
from contextlib import suppress
from typing import Any

import typer
from rich.markup import escape

from cell import __version__
from cell.cli.approve import approve
from cell.cli.audit import audit
from cell.cli.calibrate import calibrate
from cell.cli.check import check
from cell.cli.compare import compare
from cell.cli.error_model import error_model
from cell.cli.locate import locate
from cell.cli.prune import prune
from cell.cli.repair import repair
from cell.cli.report import report
from cell.cli.results import results_app
from cell.cli.run import run
from cell.cli.seal_key import seal_key_app
from cell.cli.shift import shift
from cell.cli.sim import sim
from cell.cli.streams import check_words, open_streams
from cell.cli.study import study_app
from cell.cli.view import view
from cell.cli.words import console, print_json
from cell.core.errors import BUG, INTERRUPTED, CellError, DocumentError

app = typer.Typer(
    name="cell",
    help="Robot-guided optical inspection of car bodies.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)

CLOSING_SECONDS = 10.0  # after an interrupt, for stopping, the recording's end and the report
WRONG_WORDS: Any = typer.BadParameter.__mro__[2]  # the base of usage errors, wherever click lives
REASONS = {2: "bad_input", 3: "device_fault", 4: "recording_failed", BUG: "program_fault",
           INTERRUPTED: "interrupted"}

for command in (run, shift, check, report, view, audit, repair, prune, locate, compare,
                error_model, approve, sim):
    app.command()(command)
for group in (calibrate, study_app, results_app, seal_key_app):
    app.add_typer(group)


@app.callback(invoke_without_command=True)
def _cell(version: bool = typer.Option(False, "--version", help="Print the version.")) -> None:
    if version:
        print(f"cell {__version__}")
        raise typer.Exit


def main() -> None:
    """Run one command and leave with its exit code."""
    interrupt = _Interrupt()
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's background job ignores SIGINT
        signal.signal(number, interrupt)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as under nohup
        signal.signal(signal.SIGHUP, interrupt)
    open_streams()
    sys.exit(_run())


class _Interrupt:
    """Turns signals into a KeyboardInterrupt: one, so that a second does not break off closing."""

    def __init__(self) -> None:
        self._next = 0.0

    def __call__(self, _number: int, _frame: object) -> None:
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + CLOSING_SECONDS
            raise KeyboardInterrupt


def _run() -> int:
    command = typer.main.get_command(app)
    try:  # not app(): that turns an interrupt into a code without an answer, a broken pipe into 1
        check_words(sys.argv[1:])
        return _invoke(command)
    except (KeyboardInterrupt, EOFError, typer.Abort):
        console.print("interrupted", style="yellow")
        return _fail(INTERRUPTED, "interrupted")
    except WRONG_WORDS as wrong:
        wrong.show()
        return _fail(DocumentError.exit_code, wrong.format_message())
    except CellError as error:
        return _fail(error.exit_code, _explain(error))
    except Exception as bug:  # noqa: BLE001  must never end with a code that reads as a verdict
        traceback.print_exc()
        console.print("This is a fault of the program, not of your input.", style="red")
        return _fail(BUG, repr(bug))


def _invoke(command: Any) -> int:  # noqa: ANN401  wherever click lives
    code = 0
    try:
        with command.make_context("cell", sys.argv[1:]) as context:
            command.invoke(context)
    except typer.Exit as leave:
        code = leave.exit_code
    sys.stdout.flush()  # here, where what cannot be written has an exit code
    return code


def _explain(error: CellError) -> str:
    """Say what went wrong, and what is left of the work, to people; return the same."""
    console.print(f"[red]error:[/red] {escape(str(error))}", highlight=False, soft_wrap=True)
    notes: list[str] = getattr(error, "__notes__", [])
    for note in notes:
        console.print(escape(note), highlight=False, soft_wrap=True)
    return "; ".join((str(error), *notes))


def _fail(code: int, detail: str) -> int:
    """Give the caller of `--json` its one object, also now; return the exit code."""
    if "--json" in sys.argv:
        with suppress(CellError):  # nobody can be told
            print_json({"ok": False, "reason": REASONS[code], "detail": detail})
    return code
