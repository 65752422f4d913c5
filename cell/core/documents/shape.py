"""What the shape of a value is called: a list of 3 numbers, 4 rows of 4 numbers, text."""

from __future__ import annotations

from types import NoneType, UnionType
from typing import Annotated, Any, TypeAlias, Union, get_args, get_origin

from pydantic import BaseModel

Path: TypeAlias = tuple[str | int, ...]

Kind: TypeAlias = Any
"""An annotation."""

SIMPLE: dict[Kind, tuple[str, str]] = {
    float: ("a number", "numbers"), int: ("a whole number", "whole numbers"),
    bool: ("true or false", "values true or false"), str: ("text", "texts")}


def kind_at(model: type[BaseModel], path: Path) -> Kind:
    """Return the annotation of the value at `path`; None where it is one of several."""
    kind: Kind = model
    for step in path:
        kind = _bare(_step(kind, step))
    return kind


def name_shape(kind: Kind) -> str | None:
    """Name the shape of a value for people; None where it has no simple name."""
    if kind in SIMPLE:
        return SIMPLE[kind][0]
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return f"a mapping with the keys {', '.join(kind.model_fields)}"
    if _origin(kind) is dict:
        return "a mapping"
    if _origin(kind) is not tuple:
        return None
    kinds = get_args(kind)
    if kinds[-1] is Ellipsis:
        return f"a list of {_many(kinds[0])}"
    inner = _bare(kinds[0])
    if _origin(inner) is tuple and Ellipsis not in get_args(inner):
        return f"{len(kinds)} rows of {len(get_args(inner))} {_many(get_args(inner)[0])}"
    return f"a list of {len(kinds)} {_many(kinds[0])}"


def _many(kind: Kind) -> str:
    bare = _bare(kind)
    return SIMPLE[bare][1] if bare in SIMPLE else "values"


def _step(kind: Kind, step: str | int) -> Kind:
    """Go from a value to a part of it."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        field = kind.model_fields.get(str(step))
        return None if field is None else field.annotation
    kinds = get_args(kind)
    if _origin(kind) is dict:
        return kinds[1]
    if _origin(kind) is tuple and isinstance(step, int):
        return kinds[0] if kinds[-1] is Ellipsis else kinds[min(step, len(kinds) - 1)]
    return None


def _origin(kind: Kind) -> Kind:
    return get_origin(kind)


def _bare(kind: Kind) -> Kind:
    """Take off what validates, and what may be absent; None where several are left."""
    if _origin(kind) is Annotated:
        return _bare(get_args(kind)[0])
    if _origin(kind) in (Union, UnionType):
        others = [each for each in get_args(kind) if each is not NoneType]
        return _bare(others[0]) if len(others) == 1 else None
    return kind
