"""The operator at the terminal: told, asked, never guessed for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

from cell.cli.keys import Keys
from cell.cli.words import console
from cell.core.errors import DocumentError

if TYPE_CHECKING:
    from cell.core.ports import Operator

ANEW = "\r\x1b[2K"  # back to the beginning of the line, which is emptied


@contextmanager
def operator_of(yes: bool) -> Iterator[Operator]:
    """Call the person at the terminal; for `--yes` somebody who agrees to what was planned."""
    from cell.programs.calibration.operators import Unattended

    with Keys() as keys:
        terminal = TerminalOperator(console, keys)
        yield Unattended(terminal.tell) if yes else terminal


class TerminalOperator:
    """Speaks on standard error, so that `--json` keeps standard output for itself."""

    def __init__(self, console: Console, keys: Keys) -> None:
        self._console, self._keys = console, keys
        self._glanced = ""

    def tell(self, message: str) -> None:
        """Print a line."""
        self._leave_glance()
        self._console.print(message, highlight=False, markup=False,
                            soft_wrap=not self._console.is_terminal)

    def glance(self, line: str) -> None:
        """Print over the glance before; where that cannot be, print what is new."""
        if not self._console.is_terminal:
            if line != self._glanced:
                self._console.print(line, highlight=False, markup=False, soft_wrap=True)
        else:
            self._console.file.write(ANEW + line[:self._console.width - 1])
            self._console.file.flush()
        self._glanced = line

    def confirm(self, question: str) -> bool:
        """Ask until the answer is yes or no."""
        while True:
            answer = self._read(f"{question} [yes/no] ").lower()
            if answer in ("y", "yes", "n", "no"):
                return answer.startswith("y")
            self.tell("Please answer yes or no.")

    def choose(self, question: str, options: Sequence[str]) -> str:
        """Ask until the answer is one of the options, or the beginning of just one."""
        while True:
            answer = self._read(f"{question} [{'/'.join(options)}] ").lower()
            meant = [option for option in options if answer and option.startswith(answer)]
            if len(meant) == 1:
                return meant[0]
            self.tell(f"Please answer one of: {', '.join(options)}.")

    def ask(self, question: str, default: str | None = None) -> str:
        """Ask for a line; an empty one stands for the default."""
        return self._read(f"{question} ") or default or ""

    def pressed(self) -> str | None:
        """Return the next key that was pressed, None where there is none. Never waits."""
        return self._keys.pressed()

    def _read(self, prompt: str) -> str:
        self._leave_glance()
        self._keys.rest()
        try:
            return self._console.input(prompt, markup=False).strip()
        except EOFError:
            raise DocumentError("nobody answers at the terminal: use --plan FILE --yes to run "
                                "unattended") from None

    def _leave_glance(self) -> None:
        if self._glanced and self._console.is_terminal:
            self._console.file.write("\n")
        self._glanced = ""
