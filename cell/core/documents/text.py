"""Documents as text: strict YAML in, a frozen document out, and back without loss.

The dialect is the core schema of YAML 1.2, as people expect it: `1e-05` is a number, `no` and
`2026-11-22` are text, `010` is ten. Refused are a key that stands twice, tags (they could build
objects), anchors and aliases (a few lines of them unfold to gigabytes), several documents in one
file, and nesting beyond reason.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from cell.core.documents.complaint import complain
from cell.core.documents.nominals_text import read_nominals
from cell.core.errors import DocumentError

__all__ = ["dump", "parse", "read_nominals", "read_tree"]

Model = TypeVar("Model", bound=BaseModel)
Path: TypeAlias = tuple[str | int, ...]

LONGEST = 1_000_000  # characters; a job of a thousand stops has a tenth of it
DEEPEST = 20  # levels of nesting; the documents have six

SCHEMA = {  # YAML 1.2, chapter 10.3, without hexadecimal and octal
    "null": (re.compile(r"(?:~|null|)\Z"), ["~", "n", ""]),
    "bool": (re.compile(r"(?:true|false)\Z"), list("tf")),
    "int": (re.compile(r"[-+]?[0-9]+\Z"), list("-+0123456789")),
    "float": (re.compile(r"(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
                         r"|[-+]?\.inf|\.nan)\Z"), list("-+.0123456789")),
}
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


def read_tree(text: str, source: str) -> tuple[object, dict[Path, int]]:
    """Read YAML as plain values (sequences as tuples), and the line on which each path stands.

    Raises:
        DocumentError: not YAML, or one of its refused constructs.
    """
    if len(text) > LONGEST:
        raise DocumentError(f"{len(text)} characters: a document has at most {LONGEST}",
                            source=source)
    try:
        node = _Loader(text).get_single_node()
    except yaml.YAMLError as error:
        raise _not_yaml(error, source) from None
    lines: dict[Path, int] = {}
    return (None if node is None else _value(node, (), lines, source)), lines


def dump(document: BaseModel) -> str:
    """Write a document as YAML that `parse` reads back as an equal document."""
    return yaml.dump(document.model_dump(exclude_none=True), Dumper=_Dumper, sort_keys=False,
                     allow_unicode=True, width=100)


class _Loader(yaml.SafeLoader):
    """Compose nodes of plain YAML: no tags, no anchors, no aliases, bounded depth."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  PyYAML's own way
    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _refusal("anchors (&) and aliases (*) are not used here: write it out", event)
        if getattr(event, "tag", None):
            tag = event.tag.replace(YAML, "!!")
            raise _refusal(f"the tag {tag} is not used here: only plain values", event)
        if self.depth >= DEEPEST:
            raise _refusal(f"nested more than {DEEPEST} levels deep", event)
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


class _Dumper(yaml.SafeDumper):
    """Write no aliases, keep rows of numbers on one line, quote what would be read otherwise."""

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002
        return True

    def represent_row(self, row: Sequence[object]) -> yaml.Node:
        flat = not any(isinstance(item, tuple | list | dict) for item in row)
        return self.represent_sequence(YAML + "seq", row, flow_style=flat)

    def represent_text(self, text: str) -> yaml.Node:
        style = None if text.isprintable() else '"'  # where line ends and the like are escaped
        return self.represent_scalar(YAML + "str", text, style)


for _name, (_pattern, _first) in SCHEMA.items():
    _Loader.add_implicit_resolver(YAML + _name, _pattern, _first)
    _Dumper.add_implicit_resolver(YAML + _name, _pattern, _first)
_Dumper.add_representer(tuple, _Dumper.represent_row)
_Dumper.add_representer(list, _Dumper.represent_row)
_Dumper.add_representer(str, _Dumper.represent_text)


def _value(node: yaml.Node, path: Path, lines: dict[Path, int], source: str) -> object:
    lines[path] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, path, lines, source)
    if isinstance(node, yaml.SequenceNode):
        return tuple(_value(item, (*path, i), lines, source) for i, item in enumerate(node.value))
    return _scalar(node, source)


def _mapping(node: yaml.MappingNode, path: Path, lines: dict[Path, int],
             source: str) -> Mapping[str, Any]:
    mapping: dict[str, Any] = {}
    for key, item in node.value:
        place = f"line {key.start_mark.line + 1}"
        if not isinstance(key, yaml.ScalarNode):
            raise DocumentError("a key is a word, not a list or a mapping", source=source,
                                place=place)
        if key.value in mapping:
            raise DocumentError(f"the key {key.value!r} stands twice, first on line "
                                f"{lines[(*path, key.value)]}", source=source, place=place)
        mapping[key.value] = _value(item, (*path, key.value), lines, source)
        lines[(*path, key.value)] = key.start_mark.line + 1
    return mapping


def _scalar(node: yaml.Node, source: str) -> object:
    read = {"null": lambda _: None, "bool": "true".__eq__, "int": int, "float": _float}
    kind = node.tag.removeprefix(YAML)
    try:
        return read.get(kind, str)(node.value)  # type: ignore[operator]
    except ValueError:
        raise DocumentError(f"a number of {len(node.value)} digits", source=source,
                            place=f"line {node.start_mark.line + 1}") from None


def _float(text: str) -> float:
    return float(text.replace(".inf", "inf").replace(".nan", "nan"))


def _refusal(problem: str, event: yaml.Event) -> yaml.YAMLError:
    return yaml.MarkedYAMLError(None, None, problem, event.start_mark)  # type: ignore[arg-type]


def _not_yaml(error: yaml.YAMLError, source: str) -> DocumentError:
    mark = getattr(error, "problem_mark", None)
    place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else None
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "not readable"
    if "'\\t'" in problem:
        problem = "a tab: YAML is indented with spaces"
    context = getattr(error, "context", None)
    return DocumentError(f"not valid YAML: {problem}" + (f" ({context})" if context else ""),
                         source=source, place=place)
