"""What all documents share: frozen, no unknown key, finite numbers, no guessing of types."""

from __future__ import annotations

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
