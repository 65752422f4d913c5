import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cell.core.documents import strict_yaml
from cell.core.documents.base import Document, Matrix4, Number, Vector3
from cell.core.documents.job import JobDocument
from cell.core.documents.strict_yaml import read_tree
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError

JOB = "name: sill\ncell: demo\nnominals: sill.csv\n"


def refusal(text: str) -> str:
    with pytest.raises(DocumentError) as refused:
        parse(JobDocument, text, "jobs/sill.yaml")
    assert refused.value.source == "jobs/sill.yaml"
    return str(refused.value)


@pytest.mark.parametrize(("text", "words"), [
    (JOB + "stand_off: 250\n", ["line 4", "'stand_off' is unknown", "did you mean 'stand_off_mm'"]),
    (JOB + "cell: other\n", ["line 4", "'cell' stands twice", "line 2"]),
    (JOB + "retry:\n  attempts: 2\n  attempts: 3\n", ["line 6", "stands twice", "line 5"]),
    ("name: sill\ncell: demo\n", ["the key 'nominals' is missing"]),
    (JOB + "stops:\n - joints_deg: [1, 2, 3, 4, 5, 6]\n", ["line 5", "stops[0]",
                                                            "'hole' is missing"]),
    (JOB + "stand_off_mm: -250\n", ["line 4, stand_off_mm", "greater than 0", "came -250"]),
    (JOB + "stand_off_mm: .nan\n", ["line 4", "finite number", "came nan"]),
    (JOB + "stand_off_mm: .inf\n", ["line 4", "finite number", "came inf"]),
    (JOB + "stand_off_mm: 1e999\n", ["line 4", "finite number"]),
    (JOB + "stand_off_mm: wide\n", ["line 4", "expected a number", "the text 'wide'"]),
    (JOB + "stand_off_mm: '250'\n", ["line 4", "expected a number", "without quotes"]),
    (JOB + "stand_off_mm: 250,5\n", ["line 4", "expected a number", "decimal point"]),
    (JOB + "stand_off_mm: true\n", ["line 4", "expected a number", "came true"]),
    (JOB + "retry: {attempts: 2.5}\n", ["line 4, retry.attempts", "whole number", "came 2.5"]),
    (JOB + "method: fast\n", ["line 4, method", "'joint' or 'two-step'", "'fast'"]),
    (JOB.replace("sill\n", "12\n", 1), ["line 1, name", "expected text", "put it into quotes"]),
    (JOB.replace("sill\n", "../sill\n", 1), ["line 1, name", "pattern"]),
    (JOB + "stops:\n - {hole: A, joints_deg: [1, 2, 3]}\n", ["line 5", "joints_deg",
                                                              "list of 6 numbers", "[1, 2, 3]"]),
    (JOB + "stops: [A, B]\n", ["line 4, stops[0]", "'A'"]),
    ("", ["expected a mapping", "came nothing"]),
    ("# nothing here\n", ["expected a mapping", "came nothing"]),
    ("just words", ["expected a mapping", "'just words'"]),
    ("- name\n", ["expected a mapping", "list"]),
    (JOB + "---\n" + JOB, ["line 4", "expected one document"]),
    (JOB + "stops: [\n", ["not valid YAML", "line 5"]),
    (JOB + "retry:\n\tattempts: 2\n", ["line 5", "a tab", "spaces"]),
    (JOB + "stops: !!python/object/apply:os.system ['true']\n", ["line 4", "tag", "os.system"]),
    (JOB + "stand_off_mm: !!float 3\n", ["line 4", "tag !!float"]),
    (JOB + "stops: &all []\n", ["line 4", "anchors"]),
    (JOB + "stops: " + "[" * 5000, ["line 4", "levels deep"]),
    (JOB + "stand_off_mm: 1" + "0" * 6000 + "\n", ["line 4", "digits"]),
    (JOB + "? [a, b]\n: 1\n", ["line 4", "a key is a word"]),
    ("a: ä\nname: \x00\n", ["line 2", "not valid YAML"]),
    ("x" * 1_000_001, ["1000001 characters"]),
])
@pytest.mark.parametrize("loader", [yaml.SafeLoader, strict_yaml.LOADER])
def test_a_wrong_document_is_refused_by_line_key_expected_and_came(text, words, loader,
                                                                   monkeypatch):
    monkeypatch.setattr(strict_yaml, "LOADER", loader)
    message = refusal(text)
    missing = [word for word in words if word not in message]
    assert not missing, message


def test_a_yaml_bomb_is_refused_before_it_unfolds():
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    assert "anchors" in refusal("\n".join(lines))


def test_all_faults_of_a_document_are_named_at_once():
    message = refusal(JOB + "method: fast\nretry: {attempts: 99}\nbody: sedan\n")
    assert "line 4, method" in message
    assert "also line 5, retry.attempts" in message
    assert "also line 6, body" in message


class Shapes(Document):
    matrix: Matrix4 | None = None
    pair: tuple[int, int] = (0, 0)
    any_length: tuple[Number, ...] = ()
    by_name: dict[str, Vector3] | None = None


@pytest.mark.parametrize(("written", "said"), [
    ("matrix: [[1, 0, 0, 0]]", "line 1, matrix: expected 4 rows of 4 numbers; came a list of 1"),
    ("matrix: [[1, 2], 3, 4, 5]",
     "matrix[0]: expected a list of 4 numbers; came the list [1, 2]"),
    ("pair: [768]", "pair: expected a list of 2 whole numbers; came the list [768]"),
    ("pair: [1, 2, 3]", "pair: expected a list of 2 whole numbers; came the list [1, 2, 3]"),
    ("any_length: 7", "any_length: expected a list of numbers; came 7"),
    ("by_name: 7", "by_name: expected a mapping; came 7"),
    ("by_name: {a: [1, 2]}", "by_name.a: expected a list of 3 numbers; came the list [1, 2]"),
])
def test_a_value_of_another_shape_is_told_which_one_was_expected(written, said):
    with pytest.raises(DocumentError) as refused:
        parse(Shapes, written, "shapes")
    assert said in str(refused.value)


class Values(Document):
    number: Number
    text: str = ""


@pytest.mark.parametrize(("written", "value"), [
    ("1e-05", 1e-05), ("1E5", 1e5), ("-.5", -0.5), ("7", 7.0), ("+3.", 3.0), ("010", 10.0),
    ("-0.000", -0.0),
])
def test_a_number_is_read_as_people_write_it(written, value):
    read = parse(Values, f"number: {written}\n", "values").number
    assert read == value
    assert isinstance(read, float | int)


@pytest.mark.parametrize("written", ["no", "yes", "on", "2026-11-22", "12:30:00", "0x1F", "1_000",
                                     "<<", "="])
def test_what_yaml_1_1_would_have_taken_for_something_else_is_text(written):
    assert parse(Values, f"number: 1\ntext: {written}\n", "values").text == written


@given(number=st.floats(allow_nan=False, allow_infinity=False), text=st.text(max_size=30))
def test_a_document_survives_being_written_and_read(number, text):
    written = dump(Values(number=number, text=text))
    read = parse(Values, written, "values")
    assert math.copysign(1.0, read.number) == math.copysign(1.0, number)
    assert (read.number, read.text) == (number, text)


@given(st.text(alphabet=st.characters(codec="utf-8"), max_size=60)
       | st.text(alphabet="name: [],{}\n-&*!#|>%@`\"'01.e~?\t", max_size=80))
def test_no_text_leads_to_anything_but_a_document_or_a_refusal(text):
    try:
        read_tree(text, "any")
        parse(JobDocument, text, "any")
    except DocumentError as refused:
        assert "any" in str(refused)


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
                    lambda inner: st.lists(inner, max_size=3)
                    | st.dictionaries(st.sampled_from(sorted(JobDocument.model_fields)) | st.text(
                        max_size=5), inner, max_size=4), max_leaves=12))
def test_no_structure_leads_to_anything_but_a_document_or_a_refusal(value):
    text = yaml.safe_dump(value)
    try:
        parse(JobDocument, JOB + "stops: " + "\n  ".join(["", *text.splitlines()]), "any")
    except DocumentError as refused:
        assert str(refused).startswith("any: ")
