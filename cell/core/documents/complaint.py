"""What to say of a document that does not validate: the line, the key, expected, and what came."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from cell.core.documents.shape import Path, kind_at, name_shape
from cell.core.errors import DocumentError

MOST = 5  # faults named in one message

OF_ANOTHER_SHAPE = ("missing", "too_long", "too_short", "tuple_type", "list_type", "dict_type",
                    "model_type", "string_type", "int_type", "float_type", "bool_type")


def complain(error: ValidationError, model: type[BaseModel], value: object,
             lines: Mapping[Path, int], source: str) -> DocumentError:
    """Turn what pydantic found into one error for people; `lines` says where each path stands."""
    faults: dict[str, str] = {}
    for fault in error.errors(include_url=False):
        path = _known(fault["loc"], lines)
        faults.setdefault(name_place(path, lines), _sentence(fault, model, value, path))
    (first, sentence), *others = list(faults.items())
    more = "".join(f"; also {where}: {what}" for where, what in others[:MOST - 1])
    unnamed = len(others) - (MOST - 1)
    more += f"; and {unnamed} more" if unnamed > 0 else ""
    return DocumentError(sentence + more, source=source, place=first)


def name_place(path: Path, lines: Mapping[Path, int]) -> str:
    """Name a path and its line: `line 7, stops[2].hole`."""
    key = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).strip(".")
    line = f"line {lines.get(_known(path, lines), 1)}"
    return f"{line}, {key}" if key else line


def _known(location: Path, lines: Mapping[Path, int]) -> Path:
    """The part of pydantic's location that stands in the text, without its names of unions."""
    path: Path = ()
    for step in location:
        if (*path, step) not in lines:
            break
        path = (*path, step)
    return path


def _sentence(fault: Mapping[str, Any], model: type[BaseModel], value: object, path: Path) -> str:
    kind, location = fault["type"], fault["loc"]
    if kind == "missing" and isinstance(location[-1], str):
        return f"the key {location[-1]!r} is missing"
    if kind == "extra_forbidden":
        return _unknown(str(location[-1]), _keys(model, location[:-1]))
    if not path and not isinstance(value, dict):
        return f"expected a mapping with the keys {', '.join(model.model_fields)}; " \
               f"came {_came(value)}"
    shape = name_shape(kind_at(model, path)) if kind in OF_ANOTHER_SHAPE else None
    expected = _expected(fault) if shape is None else f"expected {shape}"
    return f"{expected}; came {_came(fault['input'])}{_hint(kind, fault['input'])}"


def _expected(fault: Mapping[str, Any]) -> str:
    if fault["type"] == "string_pattern_mismatch":
        return f"expected text of the pattern {fault['ctx']['pattern']}"
    words: str = fault["msg"]
    for comparison in ("greater", "less"):
        words = words.replace(f"Input should be {comparison}", f"expected a number {comparison}")
    return words.removeprefix("Value error, ").replace("Input should be", "expected")


def _unknown(key: str, known: tuple[str, ...]) -> str:
    near = get_close_matches(key, known, n=1)
    advice = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
    return f"the key {key!r} is unknown; {advice}"


def _keys(model: type[BaseModel], location: Path) -> tuple[str, ...]:
    """The keys of the model that stands at `location`."""
    here = model
    for step in location:
        field = here.model_fields.get(str(step))
        here = next(_models(field.annotation), here) if field else here
    return tuple(here.model_fields)


def _models(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def _came(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the text {value!r}" if len(value) <= 60 else f"the text {value[:57]!r}..."
    if isinstance(value, dict):
        return f"a mapping with {len(value)} keys"
    if isinstance(value, tuple):
        short = len(value) <= 6 and not any(isinstance(each, tuple | dict) for each in value)
        return f"the list {list(value)}" if short else f"a list of {len(value)}"
    return f"{value}" if len(f"{value}") <= 60 else "a number of very many digits"


def _hint(kind: str, value: object) -> str:
    if kind == "string_type" and isinstance(value, int | float):
        return " (put it into quotes)"
    if kind == "float_type" and isinstance(value, str) and _is_number(value.replace(",", ".")):
        return " (write it without quotes, with a decimal point)"
    return ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
