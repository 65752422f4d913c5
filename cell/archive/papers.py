"""Where the papers of a run lie: the job, its nominals beside it, and the cell's folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cell.archive.files import read_text
from cell.archive.sets import CALIBRATION, active_set, cell_folder, read_set
from cell.core.documents.job import JobDocument
from cell.core.documents.papers import Papers
from cell.core.documents.text import parse
from cell.core.errors import DocumentError


@dataclass(frozen=True)
class PapersFound:
    """The exact texts of a run's documents by name, and the file of each; not yet parsed.

    `folder` is the cell's own: what `cell.yaml` names is found from there.
    """

    texts: Mapping[str, str]
    set_id: str
    sources: Mapping[str, str]
    folder: Path

    def parse(self) -> Papers:
        """Parse all documents and check that they belong together; see `Papers.parse`."""
        return Papers.parse(self.texts, self.set_id, self.sources)


def read_papers(job: Path, cell: str | None = None,
                calibration: Path = CALIBRATION) -> PapersFound:
    """Read the texts that a job stands on.

    Args:
        job: the job's file.
        cell: which cell measures; None takes the one that the job names.
        calibration: the folder with one folder a cell.

    Raises:
        DocumentError: a file is missing or unreadable, or a path leaves its folder.
    """
    job_text = read_text(job)
    document = parse(JobDocument, job_text, str(job))
    folder = cell_folder(calibration, cell or document.cell)
    set_id = active_set(folder)
    files = {"nominals": _beside(job, document.nominals), "cell": folder / "cell.yaml",
             "body": folder / "body" / f"{document.name}.yaml"}
    offsets = folder / "offsets" / f"{document.name}.yaml"
    if offsets.exists():
        files["offsets"] = offsets
    of_set = read_set(folder, set_id)
    texts = {name: read_text(file) for name, file in files.items()}
    sources = {name: str(file) for name, file in files.items()}
    return PapersFound({"job": job_text, **texts, **of_set.texts}, set_id,
                       {"job": str(job), **sources, **of_set.sources}, folder)


def _beside(job: Path, name: str) -> Path:
    """Find a file that a job names; it stays in the job's folder."""
    folder, file = (Path(os.path.realpath(path)) for path in (job.parent, job.parent / name))
    if Path(name).is_absolute() or not file.is_relative_to(folder):
        raise DocumentError(f"expected a file in the job's own folder; came {name!r}, which leaves "
                            "it", source=str(job), place="nominals")
    return job.parent / name
