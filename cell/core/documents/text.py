"""Documents as text: strict YAML in, a frozen document out, and back without loss."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from cell.core.documents.complaint import complain
from cell.core.documents.strict_yaml import read_tree, resolve

Model = TypeVar("Model", bound=BaseModel)

YAML = "tag:yaml.org,2002:"


def parse(model: type[Model], text: str, source: str) -> Model:
    """Parse YAML into a document of `model`.

    Numbers may be written with or without a decimal point, lists stand for tuples; text is never
    taken for a number, nor a number for text.

    Raises:
        DocumentError: names `source`, the line, the key, what was expected and what came.
    """
    value, lines = read_tree(text, source)
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise complain(error, model, value, lines, source) from None


def dump(document: BaseModel) -> str:
    """Write a document as YAML that `parse` reads back as an equal document."""
    return yaml.dump(document.model_dump(exclude_none=True), Dumper=_Dumper, sort_keys=False,
                     allow_unicode=True, width=100)


class _Dumper(yaml.SafeDumper):
    """Write no aliases, keep rows of numbers on one line, quote what would be read otherwise."""

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002
        return True

    def represent_row(self, row: Sequence[object]) -> yaml.Node:
        flat = not any(isinstance(item, tuple | list | dict) for item in row)
        return self.represent_sequence(YAML + "seq", row, flow_style=flat)

    def represent_text(self, text: str) -> yaml.Node:
        plain = text.isprintable() and resolve(text) is text  # line ends and the like are escaped
        return self.represent_scalar(YAML + "str", text, None if plain else '"')


_Dumper.add_representer(tuple, _Dumper.represent_row)
_Dumper.add_representer(list, _Dumper.represent_row)
_Dumper.add_representer(str, _Dumper.represent_text)
