"""Strict YAML as plain values, with the line of each.

The dialect is the core schema of YAML 1.2, as people expect it: `1e-05` is a number, `no` and
`2026-11-22` are text, `010` is ten. Refused are a key that stands twice, tags (they could build
objects), anchors and aliases (a few lines of them unfold to gigabytes), several documents in one
text, and nesting beyond reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TypeAlias

import yaml

from cell.core.errors import DocumentError

Path: TypeAlias = tuple[str | int, ...]
Lines: TypeAlias = dict[Path, int]

LONGEST = 1_000_000  # characters; a job of a thousand stops has a tenth of it
DEEPEST = 20  # levels of nesting; the documents have six

NUMBER = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
WORDS = {"": None, "~": None, "null": None, "true": True, "false": False,
         ".nan": float("nan"), ".inf": float("inf"), "+.inf": float("inf"), "-.inf": -float("inf")}
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, where PyYAML was built with it


def read_tree(text: str, source: str) -> tuple[object, Lines]:
    """Read YAML as plain values (sequences as tuples), and the line on which each path stands.

    Raises:
        DocumentError: not YAML, or one of its refused constructs; names `source` and line.
    """
    if len(text) > LONGEST:
        raise DocumentError(f"{len(text)} characters: a document has at most {LONGEST}",
                            source=source)
    try:
        return _Reader(text, source).read()
    except yaml.YAMLError as error:
        raise _not_yaml(error, text, source) from None
    except UnicodeEncodeError:
        raise DocumentError("expected Unicode text", source=source) from None


def resolve(plain: str) -> object:
    """Read a plain scalar: a number, true, false, nothing, or else text."""
    if plain in WORDS:
        return WORDS[plain]
    if not NUMBER.fullmatch(plain):
        return plain
    return int(plain) if plain.lstrip("+-").isdigit() else float(plain)


class _Reader:
    """Builds values from the events of one text."""

    def __init__(self, text: str, source: str) -> None:
        self._events: Iterator[yaml.Event] = yaml.parse(text, Loader=LOADER)
        self._source = source
        self._lines: Lines = {}

    def read(self) -> tuple[object, Lines]:
        next(self._events)  # the stream's start
        if isinstance(next(self._events), yaml.StreamEndEvent):
            return None, {}
        value = self._value(next(self._events), ())
        next(self._events)  # the document's end
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise self._refusal("expected one document; here begins another", after)
        return value, self._lines

    def _value(self, event: yaml.Event, path: Path) -> object:
        self._refuse_magic(event, path)
        self._lines.setdefault(path, _line(event))
        if isinstance(event, yaml.MappingStartEvent):
            return dict(self._items(path))
        if isinstance(event, yaml.SequenceStartEvent):
            return tuple(self._value(item, (*path, index))
                         for index, item in enumerate(self._until(yaml.SequenceEndEvent)))
        assert isinstance(event, yaml.ScalarEvent)  # nothing else is left
        return self._scalar(event)

    def _items(self, path: Path) -> Iterator[tuple[str, object]]:
        for key in self._until(yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                raise self._refusal("a key is a word, not a list or a mapping", key)
            self._refuse_magic(key, path)
            here = (*path, key.value)
            if here in self._lines:
                raise self._refusal(f"the key {key.value!r} stands twice, first on line "
                                    f"{self._lines[here]}", key)
            self._lines[here] = _line(key)
            yield key.value, self._value(next(self._events), here)

    def _until(self, end: type[yaml.Event]) -> Iterator[yaml.Event]:
        while not isinstance(event := next(self._events), end):
            yield event

    def _scalar(self, event: yaml.ScalarEvent) -> object:
        try:
            return resolve(event.value) if event.implicit[0] else event.value
        except ValueError:
            raise self._refusal(f"a number of {len(event.value)} digits", event) from None

    def _refuse_magic(self, event: yaml.Event, path: Path) -> None:
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise self._refusal("anchors (&) and aliases (*) are not used here: write it out",
                                event)
        if tag := getattr(event, "tag", None):
            plain = tag.replace("tag:yaml.org,2002:", "!!")
            raise self._refusal(f"the tag {plain} is not used here: only plain values", event)
        if len(path) > DEEPEST:
            raise self._refusal(f"nested more than {DEEPEST} levels deep", event)

    def _refusal(self, problem: str, event: yaml.Event) -> DocumentError:
        return DocumentError(problem, source=self._source, place=f"line {_line(event)}")


def _line(event: yaml.Event) -> int:
    assert event.start_mark is not None  # only events that a program makes have none
    return event.start_mark.line + 1


def _not_yaml(error: yaml.YAMLError, text: str, source: str) -> DocumentError:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "not readable"
    if isinstance(error, yaml.reader.ReaderError):
        before = text.split(chr(error.character))[0]
        return DocumentError(f"not valid YAML: {problem}", source=source,
                             place=f"line {before.count(chr(10)) + 1}")
    if mark is None:
        return DocumentError(f"not valid YAML: {problem}", source=source)
    line = text.splitlines()[mark.line:mark.line + 1]
    if line and line[0][mark.column:mark.column + 1] == "\t":
        problem = "a tab: YAML is indented with spaces"
    context = getattr(error, "context", None)
    return DocumentError(f"not valid YAML: {problem}" + (f" ({context})" if context else ""),
                         source=source, place=f"line {mark.line + 1}, column {mark.column + 1}")
