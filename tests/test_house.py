"""The house lints itself: floors, words, types and size."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LONGEST_BODY = 25  # lines of a function, docstring aside; half of them fit in six
LONGEST_FILE = 270
LARGE_ROOMS = ("cell/sim/controller",)  # the emulator may be larger


@pytest.mark.parametrize("command", [
    ["ruff", "check", "cell", "tests"],
    ["mypy"],
    ["lint-imports"],
], ids=lambda command: command[0])
def test_a_linter_finds_nothing(command: list[str]) -> None:
    tool = Path(sys.executable).with_name(command[0])
    answer = subprocess.run([tool, *command[1:]], cwd=ROOT, capture_output=True, text=True,
                            check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr


def source_files() -> list[Path]:
    return [path for path in sorted((ROOT / "cell").rglob("*.py"))
            if not path.relative_to(ROOT).as_posix().startswith(LARGE_ROOMS)]


def test_no_file_holds_two_concepts() -> None:
    lengths = {path: len(path.read_text().splitlines()) for path in source_files()}
    assert {str(path): count for path, count in lengths.items() if count > LONGEST_FILE} == {}


def body_length(function: ast.FunctionDef) -> int:
    """Count the lines from the first statement after the docstring to the last."""
    first = 1 if ast.get_docstring(function) and len(function.body) > 1 else 0
    return function.end_lineno - function.body[first].lineno + 1


def test_functions_are_small() -> None:
    long = {f"{path.relative_to(ROOT)}:{node.name}": body_length(node)
            for path in source_files() for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.FunctionDef) and body_length(node) > LONGEST_BODY}
    assert long == {}
