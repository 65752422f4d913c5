"""The door: words in, one call, words out, an exit code.

Each command is a module of this package with a function that `app` knows; what it imports from the
floors below it imports when called, so that `cell --help` answers at once.
"""

from cell.cli.door import app, main

__all__ = ["app", "main"]
