"""Operators that are no person: for runs without one, and for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Unattended:
    """Agrees to everything that was planned, retakes nothing, and types no reason."""

    say: Callable[[str], None]

    def tell(self, message: str) -> None:
        """Pass it on."""
        self.say(message)

    def confirm(self, question: str) -> bool:
        """Agree."""
        self.say(f"{question} yes")
        return True

    def choose(self, question: str, options: Sequence[str]) -> str:
        """Skip where that is offered."""
        answer = "skip" if "skip" in options else options[0]
        self.say(f"{question} {answer}")
        return answer

    def ask(self, question: str, default: str | None = None) -> str:
        """Give the default."""
        self.say(f"{question} {default or ''}")
        return default or ""

    def glance(self, line: str) -> None:
        """Pass it on."""
        self.say(line)

    def pressed(self) -> None:
        """Press no key."""
