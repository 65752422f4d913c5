"""What all documents share: frozen, no unknown key, finite numbers, no guessing of types."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from cell.core.geometry import Transform


class Document(BaseModel):
    """A frozen record that refuses unknown keys, text for numbers, NaN and infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _a_rotation(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    Transform(rows)  # type: ignore[arg-type]  # raises ValueError with the reason
    return rows


Number: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Vector2: TypeAlias = tuple[Number, Number]
Vector3: TypeAlias = tuple[Number, Number, Number]
Vector4: TypeAlias = tuple[Number, Number, Number, Number]
Vector6: TypeAlias = tuple[Number, Number, Number, Number, Number, Number]
Matrix3: TypeAlias = tuple[Vector3, Vector3, Vector3]
Matrix4: TypeAlias = Annotated[tuple[Vector4, Vector4, Vector4, Vector4],
                               AfterValidator(_a_rotation)]
"""A rigid transform, row by row, mm."""


def as_rows(transform: Transform) -> Matrix4:
    """Write a transform as a document has it."""
    a, b, c, d = (tuple(float(value) for value in row) for row in transform.matrix)
    return a, b, c, d  # type: ignore[return-value]  # four rows of four


def as_six(values: Sequence[float]) -> Vector6:
    """Write six numbers as a document has them."""
    a, b, c, d, e, f = (float(value) for value in values)
    return a, b, c, d, e, f
