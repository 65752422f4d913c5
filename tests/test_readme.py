"""Every `cell` command of the README runs as it stands there, in its order."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NO_WINDOW = {"cell view": " --picture view.png"}
MAY_SAY_NO = {"cell run": (0, 1), "cell study": (0, 1)}


def commands() -> list[str]:
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    lines = [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if line.startswith("cell ")]


def first_words(command: str) -> str:
    return " ".join(command.split()[:2])


@pytest.mark.timeout(600)
def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    for name in ("jobs", "calibration"):
        shutil.copytree(ROOT / name, tmp_path / name)
    assert len(commands()) > 8
    for command in commands():
        if command.startswith("cell view") and not has_a_viewer():
            continue
        words = command.removeprefix("cell ") + NO_WINDOW.get(first_words(command), "")
        done = subprocess.run(f"{sys.executable} -m cell {words}", shell=True, cwd=tmp_path,
                              executable="/bin/bash", text=True, capture_output=True,
                              stdin=subprocess.DEVNULL, timeout=200, check=False)
        assert done.returncode in MAY_SAY_NO.get(first_words(command), (0,)), \
            f"{command}\n{done.stdout}\n{done.stderr}"


def test_every_command_of_the_program_is_in_the_readme() -> None:
    from cell.cli.door import app

    text = (ROOT / "README.md").read_text()
    names = [command.name or command.callback.__name__.replace("_", "-")
             for command in app.registered_commands]
    names += [group.name or group.typer_instance.info.name for group in app.registered_groups]
    assert [name for name in names if f"cell {name}" not in text] == []


def has_a_viewer() -> bool:
    """Whether a software renderer is there for the picture that stands for the window."""
    return bool(list(Path("/usr/share/vulkan/icd.d").glob("*.json")))
