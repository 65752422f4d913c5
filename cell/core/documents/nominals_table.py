"""The nominals as a CSV table: read, checked row by row and as a whole."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from cell.core.documents.nominals import AXES, Hole
from cell.core.documents.table import Row, read_table
from cell.core.geometry import Array

REQUIRED = ("id", "x", "y", "z", "i", "j", "k", "diameter", "thickness", "side", "control",
            "tol_x", "tol_y", "tol_z", "tol_d")
OPTIONAL = ("class", "cmm_x", "cmm_y", "cmm_z", "cmm_d", "cmm_u")
IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")

NORMAL_TOLERANCE = 0.01  # of the length 1: rounding, not another unit
SMALLEST_DIAMETER, SMALLEST_THICKNESS = 0.1, 0.05  # mm; below, the table is in metres
THICKEST = 100.0  # mm; above, the sheet is in micrometres
LONGEST_BODY = 20_000.0  # mm; above, the table is in micrometres


def read_nominals(text: str, source: str) -> tuple[Hole, ...]:
    """Read the holes of a nominals table, in mm and body coordinates.

    Raises:
        DocumentError: names `source`, line, hole and column, what was expected and what came.
    """
    rows = read_table(text, source, REQUIRED, OPTIONAL)
    holes = tuple(_hole(row) for row in rows)
    if not holes:
        raise Row(source, 1, {}).refuse("the table has a header but no hole")
    check_ids(rows)
    _check_unit(holes, rows)
    return holes


def check_ids(rows: Sequence[Row]) -> None:
    """Refuse ids that stand twice."""
    lines: dict[str, int] = {}
    for row in rows:
        name = row.cells["id"]
        if name in lines:
            raise row.refuse(f"the id {name!r} stands twice, first on line {lines[name]}", "id")
        lines[name] = row.line


def read_id(row: Row) -> str:
    """Read the id of a row: it becomes part of paths and tables, so it is kept plain."""
    name = row.cells["id"]
    if not name:
        raise row.refuse("the id is missing", "id")
    if not IDENTIFIER.fullmatch(name):
        raise row.refuse(f"expected an id of letters, digits, '.', '_' or '-', beginning with a "
                         f"letter or digit, at most 64 long; came {name!r}", "id")
    return name


def read_control(row: Row, axes: str) -> frozenset[str]:
    """Read which of `axes` count."""
    control = row.cells["control"]
    for letter in control:
        if letter not in axes:
            raise row.refuse(f"expected some of the letters {axes}; came {control!r}", "control")
    if len(set(control)) < len(control):
        raise row.refuse(f"a letter stands twice in {control!r}", "control")
    return frozenset(control)


def _hole(row: Row) -> Hole:
    name, control = read_id(row), read_control(row, "".join(AXES))
    return Hole(name, np.array([row.number(axis) for axis in "xyz"]), _normal(row),
                row.positive("diameter"), row.not_negative("thickness"), _side(row), control,
                {axis: row.positive(f"tol_{axis}") for axis in AXES if axis in control},
                row.cells.get("class", ""), _cmm(row),
                row.not_negative("cmm_u") if row.cells.get("cmm_u") else None)


def _side(row: Row) -> Literal["camera", "back"]:
    match row.cells["side"]:
        case "camera":
            return "camera"
        case "back":
            return "back"
    raise row.refuse(f"expected 'camera' or 'back'; came {row.cells['side']!r}", "side")


def _normal(row: Row) -> Array:
    normal = np.array([row.number(axis) for axis in "ijk"])
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        raise row.refuse("the normal i, j, k is zero: it has no direction")
    if not abs(length - 1.0) <= NORMAL_TOLERANCE:
        raise row.refuse(f"expected a normal i, j, k of length 1; came length {length:.4g}")
    return normal / length


def _cmm(row: Row) -> dict[str, float] | None:
    found = {axis: row.number_or_none(f"cmm_{axis}") for axis in AXES}
    return {axis: value for axis, value in found.items() if value is not None} or None


def _check_unit(holes: Sequence[Hole], rows: Sequence[Row]) -> None:
    """Refuse metres and micrometres: by size of holes, sheet and body."""
    extent = float(np.ptp([hole.centre for hole in holes], axis=0).max())
    widest = max(hole.diameter for hole in holes)
    if len(holes) > 1 and extent < widest:
        raise Row(rows[0].source, rows[0].line, {}).refuse(
            f"all holes lie within {extent:.3g} mm, less than the widest hole ({widest:g} mm): "
            "the coordinates look like metres; expected millimetres")
    for hole, row in zip(holes, rows, strict=True):
        if hole.diameter < SMALLEST_DIAMETER:
            raise row.refuse(f"a diameter of {hole.diameter:g} mm looks like metres; "
                             "expected millimetres", "diameter")
        if 0.0 < hole.thickness < SMALLEST_THICKNESS:
            raise row.refuse(f"a sheet of {hole.thickness:g} mm looks like metres; "
                             "expected millimetres", "thickness")
        if hole.thickness > THICKEST:
            raise row.refuse(f"a sheet of {hole.thickness:g} mm: expected at most {THICKEST:g}, "
                             "in millimetres", "thickness")
        if np.abs(hole.centre).max() > LONGEST_BODY:
            raise row.refuse(f"a hole {np.abs(hole.centre).max() / 1000:.4g} m from the origin: "
                             "expected millimetres")
