"""Tables as text: CSV with a header, commas and decimal points; each row knows its line."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from cell.core.errors import DocumentError

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
LARGEST = 1e12  # what lies beyond is no measure of anything
ALSO_CALLED = {"d": "diameter", "diameter": "d"}  # measured points have d, nominals a diameter
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+", re.ASCII)


@dataclass(frozen=True)
class Row:
    """One row: its line, its cells by column (stripped), and what it is called in messages."""

    source: str
    line: int
    cells: dict[str, str]

    def refuse(self, message: str, column: str | None = None) -> DocumentError:
        """Build the error that names this row, and the column where it is one cell's fault."""
        name = self.cells.get("id", "")
        place = f"line {self.line}" + (f" ({name})" if name.isprintable() and name else "")
        return DocumentError(message, source=self.source,
                             place=place + (f", column {column}" if column else ""))

    def number(self, column: str) -> float:
        """Read a finite number; an empty cell is refused."""
        text = self.cells.get(column, "")
        if not text:
            raise self.refuse("expected a number; the cell is empty", column)
        if DECIMAL_COMMA.fullmatch(text):
            raise self.refuse(f"a decimal comma: write {text.replace(',', '.')} instead of {text}",
                              column)
        if not NUMBER.fullmatch(text) or abs(float(text)) > LARGEST:
            raise self.refuse(f"expected a finite number; came {text!r}", column)
        return float(text)

    def positive(self, column: str) -> float:
        """Read a number above 0."""
        value = self.number(column)
        if value <= 0.0:
            raise self.refuse(f"expected a number above 0; came {value:g}", column)
        return value

    def not_negative(self, column: str) -> float:
        """Read a number of 0 or more."""
        value = self.number(column)
        if value < 0.0:
            raise self.refuse(f"expected 0 or more; came {value:g}", column)
        return value

    def number_or_none(self, column: str) -> float | None:
        """Read a finite number, or None from an empty cell or an absent column."""
        return self.number(column) if self.cells.get(column) else None


def read_table(text: str, source: str, required: Sequence[str],
               optional: Sequence[str] = ()) -> tuple[Row, ...]:
    """Read a CSV table whose header has all `required` columns and none beyond the `optional`.

    A byte order mark, blank lines and spaces round a cell are tolerated.

    Raises:
        DocumentError: names the line and what is wrong with header, row or quoting.
    """
    try:
        rows = list(_rows(text.removeprefix("\ufeff")))
    except csv.Error as error:
        raise DocumentError(f"not a CSV table: {error}", source=source) from None
    if not rows:
        raise DocumentError(f"the table is empty; expected the columns {', '.join(required)}",
                            source=source)
    (line, header), *body = rows
    for problem in _header_problems(header, tuple(required), tuple(optional)):
        raise DocumentError(f"{problem}; expected the columns {', '.join(required)}"
                            + (f" and optionally {', '.join(optional)}" if optional else ""),
                            source=source, place=f"line {line}")
    return tuple(_row(header, cells, Row(source, number, {})) for number, cells in body)


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    for cells in reader:
        stripped = [cell.strip() for cell in cells]
        if any(stripped):
            yield reader.line_num, stripped


def _header_problems(header: list[str], required: tuple[str, ...],
                     optional: tuple[str, ...]) -> Iterator[str]:
    """Find what is wrong with a header, the most telling first."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if any(separator in column for column in header):
            yield f"the columns are separated by {name}: expected commas, and decimal points"
    for column in header:
        if header.count(column) > 1:
            yield f"the column {column!r} stands twice"
        if column not in required + optional:
            absent = [name for name in required + optional if name not in header]
            yield f"the column {column!r} is unknown{_advice(column, absent)}"
    if missing := [column for column in required if column not in header]:
        yield f"missing: {', '.join(missing)}"


def _advice(name: str, known: Sequence[str]) -> str:
    other = ALSO_CALLED.get(name.lower())
    near = [other] if other in known else get_close_matches(name.lower(), known, n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def _row(header: list[str], cells: list[str], row: Row) -> Row:
    if len(cells) != len(header):
        comma = " (a decimal comma? numbers are written with a point)" \
            if len(cells) > len(header) else ""
        raise row.refuse(f"{len(cells)} cells where the header has {len(header)} columns{comma}")
    return Row(row.source, row.line, dict(zip(header, cells, strict=True)))
