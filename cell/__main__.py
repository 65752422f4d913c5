"""`python -m cell` is the command `cell`."""

from cell.cli import main

main()
