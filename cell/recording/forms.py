"""How a record becomes plain values and comes back, exactly: one form a type, read off its fields.

Plain values are what Arrow stores as typed columns and what the hash chain is taken over: numbers,
texts, lists, pairs. Float64 stays float64; an array keeps its shape; of an image only the hash of
its pixels is part of the record, the pixels lie beside it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from itertools import pairwise
from types import NoneType, UnionType
from typing import Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import numpy as np
import pyarrow as pa

from cell.core.geometry import Array, Transform
from cell.core.observation import Image

Plain: TypeAlias = Any
"""Numbers, texts, None, lists and dictionaries of them."""

Value: TypeAlias = Any
"""What a field of a record holds."""


@dataclass(frozen=True)
class Form:
    """One type: its column type, the way to plain values and the way back."""

    column: pa.DataType
    plain: Callable[[Value], Plain]
    value: Callable[[Plain], Value]


def canonical(plain: Plain) -> bytes:
    """Write plain values as the bytes that are hashed: JSON, keys sorted, a float by its shortest
    exact digits, a row of float64 by its bytes (little-endian) in hexadecimal.
    """
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), default=_row_bytes).encode()


def _row_bytes(row: Array) -> str:
    return row.astype("<f8").tobytes().hex()


def plains_of(column: pa.Array) -> list[Plain]:
    """Take the values of a column as `Form.plain` makes them: rows of float64 as arrays."""
    if column.null_count == len(column):
        return [None] * len(column)
    values = _values_of(column)
    if not column.null_count:
        return values
    return [value if valid else None
            for value, valid in zip(values, column.is_valid().to_pylist(), strict=True)]


def _values_of(column: pa.Array) -> list[Plain]:
    """Read a column by columns, nulls as they lie: Arrow is slow at single values."""
    if pa.types.is_struct(column.type):
        names = column.type.names
        parts = [plains_of(column.field(name)) for name in names]
        return [dict(zip(names, row, strict=True)) for row in zip(*parts, strict=True)]
    if pa.types.is_map(column.type):
        return _rows_of(column, lambda pairs: list(zip(
            plains_of(pairs.field(0)), plains_of(pairs.field(1)), strict=True)))
    if not pa.types.is_list(column.type):
        return column.to_pylist()
    if column.type.value_type == pa.float64():
        return _rows_of(column, lambda values: values.to_numpy(zero_copy_only=False))
    return _rows_of(column, plains_of)


def _rows_of(column: pa.Array, read: Callable[[pa.Array], Any]) -> list[Plain]:
    """Read the values of all rows at once, and part them again."""
    ends = column.offsets.to_pylist()
    values = read(column.values[ends[0]:ends[-1]])
    return [values[begin - ends[0]:end - ends[0]] for begin, end in pairwise(ends)]


def as_recorded(record: Value) -> Value:
    """Return a record as it would come back from a recording."""
    kind: Value = type(record)
    form = form_of(kind)
    return form.value(form.plain(record))


def pixel_hash(image: Image) -> str:
    """Hash the size and the pixels of an image (sha256, hexadecimal)."""
    digest = hashlib.sha256(f"{image.shape[0]}x{image.shape[1]} uint8\n".encode())
    digest.update(np.ascontiguousarray(image).data)
    return digest.hexdigest()


@cache
def form_of(kind: Value) -> Form:
    """Return the form of a type: a number, text, array, transform, record, or what is made of them.

    Raises:
        TypeError: a type that recordings do not know.
    """
    if kind in SIMPLE:
        return SIMPLE[kind]
    if isinstance(kind, type) and is_dataclass(kind):
        return _record(kind)
    build = COMPOSED.get(get_origin(kind))
    if build is None:
        raise TypeError(f"recordings have no form for {kind}")
    return build(get_args(kind))


def _record(kind: type) -> Form:
    hints = get_type_hints(kind)
    forms = {field.name: form_of(hints[field.name]) for field in fields(kind)}
    optional = {field.name for field in fields(kind)
                if field.default is not MISSING or field.default_factory is not MISSING}

    def value(plain: dict[str, Plain]) -> Value:
        if unknown := plain.keys() - forms.keys():
            raise ValueError(f"{kind.__name__} has unknown fields: {', '.join(sorted(unknown))}")
        if missing := forms.keys() - plain.keys() - optional:
            raise ValueError(f"{kind.__name__} lacks {', '.join(sorted(missing))}")
        return kind(**{name: forms[name].value(plain[name]) for name in forms if name in plain})

    return Form(pa.struct({name: form.column for name, form in forms.items()}),
                lambda record: {name: form.plain(getattr(record, name))
                                for name, form in forms.items()},
                value)


def _union(kinds: tuple[Any, ...]) -> Form:
    chosen = tuple(kind for kind in kinds if kind is not NoneType)
    form = form_of(chosen[0]) if len(chosen) == 1 else _alternatives(chosen)
    if len(chosen) == len(kinds):
        return form
    return Form(form.column,
                lambda value: None if value is None else form.plain(value),
                lambda plain: None if plain is None else form.value(plain))


def _alternatives(kinds: tuple[Any, ...]) -> Form:
    """Records of different types: one column each, of which one is filled."""
    forms = {kind.__name__: form_of(kind) for kind in kinds}

    def plain(value: Value) -> dict[str, Plain]:
        own = type(value).__name__
        return {name: form.plain(value) if name == own else None for name, form in forms.items()}

    def value(plain: dict[str, Plain]) -> Value:
        (name,) = (name for name, content in plain.items() if content is not None)
        return forms[name].value(plain[name])

    return Form(pa.struct({name: form.column for name, form in forms.items()}), plain, value)


def _sequence(kinds: tuple[Any, ...]) -> Form:
    form = form_of(kinds[0])
    if form is SIMPLE[float]:
        return Form(pa.list_(form.column), lambda values: np.array(values, dtype=np.float64),
                    lambda plain: tuple(plain.tolist()))
    return Form(pa.list_(form.column),
                lambda values: [form.plain(value) for value in values],
                lambda plain: tuple(form.value(each) for each in plain))


def _mapping(kinds: tuple[Any, ...]) -> Form:
    key, form = kinds[0], form_of(kinds[1])
    return Form(pa.map_(form_of(key).column, form.column),
                lambda pairs: [(name, form.plain(value)) for name, value in pairs.items()],
                lambda plain: {name: form.value(value) for name, value in plain})


def _plain_array(array: Array) -> dict[str, Any]:
    exact = np.asarray(array, dtype=np.float64)
    return {"shape": list(exact.shape), "values": exact.ravel()}


def _array(plain: dict[str, Any]) -> Array:
    return np.array(plain["values"], dtype=np.float64).reshape(plain["shape"])


def _listed(value: Value) -> Plain:
    return value.tolist()


def _unchanged(value: Value) -> Value:
    return value


ARRAY = Form(pa.struct({"shape": pa.list_(pa.int64()), "values": pa.list_(pa.float64())}),
             _plain_array, _array)
TEXT = Form(pa.string(), str, str)

SIMPLE: dict[Any, Form] = {
    float: Form(pa.float64(), float, float),
    int: Form(pa.int64(), int, int),
    bool: Form(pa.bool_(), bool, bool),
    str: TEXT,
    Array: ARRAY,
    Transform: Form(pa.list_(pa.float64()), lambda transform: transform.matrix.ravel(),
                    lambda plain: Transform(np.reshape(plain, (4, 4)))),
    Image: Form(pa.string(), pixel_hash, _unchanged),
    Any: Form(pa.string(), lambda value: json.dumps(value, default=_listed), json.loads),
}

COMPOSED: dict[Any, Callable[[tuple[Any, ...]], Form]] = {
    Union: _union,
    UnionType: _union,
    tuple: _sequence,
    dict: _mapping,
    Mapping: _mapping,
    Literal: lambda _: TEXT,
}
