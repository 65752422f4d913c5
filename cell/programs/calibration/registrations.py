"""Body registrations on the disk, and drift taken back in them: on request and bounded."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from cell.archive.files import read_text, replace_text
from cell.core.documents.base import Matrix4, as_rows
from cell.core.documents.calibration import BodyDocument
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.metrology.study.drift import is_small


def write_registration(file: Path, document: BodyDocument) -> None:
    """Replace a registration in one step; the one before is kept beside it.

    Raises:
        DocumentError: the disk refuses.
    """
    if file.exists():
        past = file.parent / "history"
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H%M%SZ")
        replace_text(past / f"{file.stem}-until-{now}.yaml", file.read_text("utf-8"))
    replace_text(file, dump(document))


def plan_corrections(folder: Path, set_id: str, now_from_reference: Transform
                     ) -> dict[str, Matrix4]:
    """Work out the whole correction of every registration of a set, by the job's name.

    Raises:
        DocumentError: one would be beyond what a correction may ever be: calibrate again.
    """
    corrections = {}
    for file in sorted((folder / "body").glob("*.yaml")):
        document = _read(file)
        if document.calibration_set not in (None, set_id):
            continue
        known = np.eye(4) if document.drift_correction is None else document.drift_correction
        whole = now_from_reference @ Transform(np.array(known))
        if not is_small(whole):
            raise DocumentError("all corrections together would be beyond 0.3 mm or 0.03 degrees: "
                                "calibrate again", source=str(file))
        corrections[file.stem] = as_rows(whole)
    return corrections


def apply_corrections(folder: Path, corrections: dict[str, Matrix4]) -> None:
    """Write whole corrections into the registrations; what is there already stays as it is."""
    for job, correction in corrections.items():
        file = folder / "body" / f"{job}.yaml"
        document = _read(file)
        rows = as_rows(Transform(np.array(correction)))
        if document.drift_correction != rows:
            write_registration(file, document.model_copy(update={"drift_correction": rows}))


def _read(file: Path) -> BodyDocument:
    return parse(BodyDocument, read_text(file), str(file))
