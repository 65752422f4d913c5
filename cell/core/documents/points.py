"""Tables of points to compare: `id,x,y,z` in mm, with empty cells where an axis does not count."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cell.core.documents.nominals import AXES
from cell.core.documents.nominals_table import OPTIONAL, REQUIRED, check_ids, read_control, read_id
from cell.core.documents.table import Row, read_table
from cell.core.errors import DocumentError

COORDINATES = ("id", "x", "y", "z")
SHORTEST_BODY = 10.0  # mm, over three points or more; a shorter one is in metres


@dataclass(frozen=True)
class Point:
    """One point of a table: its values by axis of `xyzd` (mm); what does not count is absent."""

    id: str
    values: dict[str, float]


def read_measured_points(text: str, source: str) -> tuple[Point, ...]:
    """Read `id,x,y,z` and optionally `d`. An id may stand several times: repeated measurements.

    Raises:
        DocumentError: names line, id and column, what was expected and what came.
    """
    rows = read_table(text, source, COORDINATES, ("d",))
    return _checked([Point(read_id(row), _values(row, AXES, "d")) for row in rows], source)


def read_nominal_points(text: str, source: str) -> tuple[Point, ...]:
    """Read `id,x,y,z` and optionally `control`; other columns of a nominals table may stand there.

    Raises:
        DocumentError: names line, id and column, what was expected and what came.
    """
    others = [name for name in (*REQUIRED, *OPTIONAL) if name not in COORDINATES]
    rows = read_table(text, source, COORDINATES, others)
    check_ids(rows)
    return _checked([Point(read_id(row), _values(row, _controlled(row), "diameter"))
                     for row in rows], source)


def _controlled(row: Row) -> Iterable[str]:
    return read_control(row, "".join(AXES)) if "control" in row.cells else AXES


def _values(row: Row, axes: Iterable[str], diameter: str) -> dict[str, float]:
    """Read the axes whose cells are filled."""
    columns = {axis: diameter if axis == "d" else axis for axis in AXES if axis in axes}
    found = {axis: row.number_or_none(column) for axis, column in columns.items()}
    return {axis: value for axis, value in found.items() if value is not None}


def _checked(points: list[Point], source: str) -> tuple[Point, ...]:
    if not points:
        raise DocumentError("the table has a header but no point", source=source, place="line 1")
    extents = [np.ptp([point.values[axis] for point in points if axis in point.values] or [0.0])
               for axis in "xyz"]
    if len({point.id for point in points}) >= 3 and max(extents) < SHORTEST_BODY:
        raise DocumentError(f"all points lie within {max(extents):.3g} mm: they look like metres; "
                            "expected millimetres", source=source)
    return tuple(points)
