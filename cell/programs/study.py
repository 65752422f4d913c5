"""Measurement system studies over tables of measured values."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from cell.core.documents.nominals import AXES
from cell.core.errors import DocumentError
from cell.core.geometry import Array
from cell.metrology.study.nested import Component, solve_components
from cell.metrology.study.studies import (
    Spread,
    StudyRefusedError,
    Type1,
    Type1Rule,
    Type3,
    solve_spread,
    solve_type1,
    solve_type3,
)
from cell.programs.results import read_rows

LABELS = ("location", "approach", "part")
Answer = TypeVar("Answer")


@dataclass(frozen=True, eq=False)
class Sample:
    """The values (n,) of one axis of one feature, with their labels where the table has them."""

    feature: str
    axis: str
    values: Array
    labels: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Repeatability:
    """The spread of one axis and, where approaches are labelled, its split by cause."""

    spread: Spread
    components: tuple[Component, ...] = ()


@dataclass(frozen=True, eq=False)
class Finding(Generic[Answer]):
    """What a study says of one sample: an answer, or the reason why there is none."""

    sample: Sample
    answer: Answer | None
    refused: str = ""


def study_repeatability(samples: Sequence[Sample],
                        confidence: float = 0.95) -> list[Finding[Repeatability]]:
    """Study how far repeated values scatter, split by sensor, robot and location where labelled."""
    return [_found(sample, lambda s: _repeatability(s, confidence)) for sample in samples]


def study_type1(samples: Sequence[Sample], references: dict[str, float], tolerance: float,
                rule: Type1Rule, confidence: float = 0.95) -> list[Finding[Type1]]:
    """Study Cg and Cgk of every axis that has a reference value.

    Raises:
        DocumentError: a reference is of an axis that was not measured.
    """
    measured = dict.fromkeys(sample.axis for sample in samples)
    if unknown := references.keys() - measured.keys():
        raise DocumentError(f"of the axis {', '.join(sorted(unknown))} nothing was measured; "
                            f"there is {', '.join(measured)}", place="--reference")
    return [_found(sample, lambda s: solve_type1(s.values, references[s.axis], tolerance, rule,
                                                 confidence))
            for sample in samples if sample.axis in references]


def study_type3(samples: Sequence[Sample], tolerance: float,
                confidence: float = 0.95) -> list[Finding[Type3]]:
    """Study the machine's share of the tolerance over several parts (column `part`)."""
    return [_found(sample, lambda s: solve_type3(_by_part(s), tolerance, confidence))
            for sample in samples]


def read_samples(files: Sequence[Path]) -> list[Sample]:
    """Read tables with the columns `id`, some of `x,y,z,d`, and `location,approach,part` if known,
    or recordings, of which each is a part.

    An empty number is a value that was not measured: it is left out, never taken as 0.

    Raises:
        DocumentError: a file cannot be read, a column is missing, a cell is not a number, or there
            is no number at all.
    """
    rows = [row for file in files
            for row in (_recorded_rows if file.suffix == ".rrd" else _rows)(file)]
    features = dict.fromkeys(row["id"] for row in rows)
    samples = [_sample([row for row in rows if row["id"] == feature], feature, axis)
               for feature in features for axis in AXES]
    if not any(sample.values.size for sample in samples):
        raise DocumentError("nothing was measured", source=", ".join(map(str, files)))
    return [sample for sample in samples if sample.values.size]


def _found(sample: Sample, solve: Callable[[Sample], Answer]) -> Finding[Answer]:
    try:
        return Finding(sample, solve(sample))
    except StudyRefusedError as refusal:
        return Finding(sample, None, str(refusal))


def _repeatability(sample: Sample, confidence: float) -> Repeatability:
    spread, approaches = solve_spread(sample.values, confidence), sample.labels.get("approach")
    if approaches is None:
        return Repeatability(spread)
    return Repeatability(spread, solve_components(
        sample.values, approaches, sample.labels.get("location"), confidence))


def _by_part(sample: Sample) -> list[Array]:
    if "part" not in sample.labels:
        raise StudyRefusedError("the table has no column `part`: which part was each value of?")
    parts = np.array(sample.labels["part"])
    return [sample.values[parts == part] for part in dict.fromkeys(sample.labels["part"])]


def _rows(file: Path) -> Iterator[dict[str, str]]:
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            reader = csv.DictReader(lines)
            _check_columns(file, reader.fieldnames or ())
            for number, row in enumerate(reader, start=2):
                yield {**{key: (text or "").strip() for key, text in row.items() if key},
                       "where": f"line {number}", "file": str(file)}
    except (OSError, UnicodeDecodeError, csv.Error) as wrong:
        raise DocumentError(f"cannot be read: {wrong}", source=str(file)) from wrong


def _recorded_rows(file: Path) -> Iterator[dict[str, str]]:
    """Give what a recording measured, in the body frame as it was judged."""
    rows = read_rows(file)
    for feature in rows.features:
        values = {row["axis"]: repr(row["measured"]) for row in rows.axes
                  if row["feature"] == feature["feature"] and row["measured"] is not None}
        yield {"id": feature["feature"], **values, "part": rows.body["body_id"],
               "where": "hole", "file": str(file)}


def _check_columns(file: Path, names: Sequence[str]) -> None:
    if "id" not in names or not set(names) & set(AXES):
        raise DocumentError("expected a column `id` and at least one of x, y, z, d; got "
                            + (", ".join(names) or "an empty file"), source=str(file))


def _sample(rows: list[dict[str, str]], feature: str, axis: str) -> Sample:
    filled = [row for row in rows if row.get(axis)]
    values = np.array([_number(row, axis) for row in filled], dtype=np.float64)
    labels = {label: tuple(row[label] for row in filled) for label in LABELS
              if filled and all(row.get(label) for row in filled)}
    return Sample(feature, axis, values, labels)


def _number(row: dict[str, str], axis: str) -> float:
    try:
        value = float(row[axis])
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise DocumentError(f"expected a number, got {row[axis]!r}", source=row["file"],
                            place=f"{row['where']}, column {axis}")
    return value
