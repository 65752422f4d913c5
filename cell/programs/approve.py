"""Approving papers: the hashes of job and calibration, with who and when.

    job           the job file and its nominals
    calibration   sensor, hand-eye, body registration, and kinematics and offsets where they exist
    cell          cell.yaml: devices, limits, speeds

Whatever changes a letter of them is another paper, and a TRIAL until somebody approves it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from cell.archive.papers import PapersFound, read_papers
from cell.core.errors import DocumentError
from cell.results.approvals import approve, withdraw
from cell.results.booking import CALIBRATION_PAPERS, Row, hash_texts
from cell.results.database import Database

KINDS = {"job": ("job", "nominals"), "calibration": CALIBRATION_PAPERS, "cell": ("cell",)}


def approval_hashes(texts: Mapping[str, str]) -> dict[str, str]:
    """Hash the papers of a run by kind."""
    return {kind: hash_texts({name: texts[name] for name in names if name in texts})
            for kind, names in KINDS.items()}


def approve_job(database: Database, job: Path, by: str, cell: str | None = None,
                note: str = "") -> list[Row]:
    """Approve a job and the calibration that its cell measures with now.

    Raises:
        DocumentError: a paper is wrong; what cannot run cannot be approved.
    """
    if not by.strip():
        raise DocumentError("an approval needs a name", place="--by")
    found = read_papers(job, cell)
    found.parse()
    names = {"job": str(job), "calibration": found.set_id, "cell": found.folder.name}
    rows = [{"hash": digest, "kind": kind, "name": names[kind], "approved_by": by.strip(),
             "approved_at": time.time(), "note": note}
            for kind, digest in _hashes(found).items()]
    approve(database, rows)
    return rows


def withdraw_job(database: Database, job: Path, cell: str | None = None) -> int:
    """Take the approval of a job as it stands back; calibration and cell keep theirs."""
    return withdraw(database, [_hashes(read_papers(job, cell))["job"]], time.time())


def _hashes(found: PapersFound) -> dict[str, str]:
    return approval_hashes(found.texts)
