"""The command as a shell would call it, and the demo's documents, free to be spoilt."""

import sys

import pytest
from made_workplace import workplace

from cell.cli import main

__all__ = ["cell", "workplace"]


@pytest.fixture
def cell(monkeypatch, capsys):
    """Call the command as a shell would: (exit code, standard output, standard error)."""
    def call(*words):
        monkeypatch.setattr(sys, "argv", ["cell", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        said = capsys.readouterr()
        return left.value.code or 0, said.out, said.err

    return call
