"""The line: how a PLC, or a person in its place, speaks with the cell."""
