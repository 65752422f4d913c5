"""The operator at the terminal: told, asked, never guessed for."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from cell.core.errors import DocumentError


class TerminalOperator:
    """Speaks on standard error, so that `--json` keeps standard output for itself."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def tell(self, message: str) -> None:
        """Print a line."""
        self._console.print(message, highlight=False, markup=False)

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

    def _read(self, prompt: str) -> str:
        try:
            return self._console.input(prompt, markup=False).strip()
        except EOFError:
            raise DocumentError("nobody answers at the terminal: use --plan FILE --yes to run "
                                "unattended") from None
