"""A working folder with the demo's documents, free to be spoilt."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from cell.archive.papers import read_papers
from cell.core.documents.papers import Papers

REPOSITORY = Path(__file__).parents[1]


@dataclass(frozen=True)
class Workplace:
    """A copy of `jobs/` and `calibration/` in a folder of its own."""

    folder: Path

    @classmethod
    def in_folder(cls, folder: Path) -> "Workplace":
        for name in ("jobs", "calibration"):
            shutil.copytree(REPOSITORY / name, folder / name)
        return cls(folder)

    @property
    def job(self) -> Path:
        return self.folder / "jobs" / "demo.yaml"

    @property
    def nominals(self) -> Path:
        return self.folder / "jobs" / "demo.csv"

    @property
    def cell(self) -> Path:
        return self.folder / "calibration" / "demo"

    @property
    def active_set(self) -> Path:
        return next((self.cell / "sets").iterdir())

    @property
    def documents(self) -> dict[str, Path]:
        """All documents of the demo job, by name."""
        return {"job": self.job, "nominals": self.nominals, "cell": self.cell / "cell.yaml",
                "body": self.cell / "body" / "demo.yaml", "active": self.cell / "active.yaml",
                "sensor": self.active_set / "sensor.yaml",
                "hand_eye": self.active_set / "hand_eye.yaml"}

    def replace(self, file: Path, old: str, new: str) -> None:
        """Replace the first `old` in a file; it must be there."""
        text = file.read_text()
        assert old in text, f"{old!r} is not in {file.name}"
        file.write_text(text.replace(old, new, 1))

    def papers(self) -> Papers:
        return read_papers(self.job, None, self.folder / "calibration").parse()


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workplace:
    """A working folder with a copy of the demo's documents; the test runs in it."""
    monkeypatch.chdir(tmp_path)
    return Workplace.in_folder(tmp_path)
