"""The shift: bodies after bodies, unattended, right verdicts, nothing lost."""
