"""Which set a cell measures with: activated in one step, every change kept in the history."""

from __future__ import annotations

import json
from pathlib import Path

from cell.archive.files import append_line, read_json_lines, replace_text
from cell.archive.sets import read_active, read_set
from cell.core.documents.calibration import ActiveDocument, HandEyeDocument, SensorDocument
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError

HISTORY = "history.jsonl"


def activate(folder: Path, set_id: str, *, by: str, at: str, reason: str = "") -> ActiveDocument:
    """Make a set the one that the cell measures with.

    Args:
        folder: the cell's folder.
        set_id: an intact set of this cell.
        by: who.
        at: when (UTC), as 2026-11-22T09:55:00Z.
        reason: why, for the history.

    Raises:
        DocumentError: no such set, it is not intact, or the folder cannot be written.
    """
    read_set(folder, set_id)
    previous = read_active(folder) if (folder / "active.yaml").exists() else None
    active = ActiveDocument(set=set_id, by=by, at=at, reason=reason,
                            previous=previous.set if previous else None)
    if previous:
        _note(folder, previous)
    replace_text(folder / "active.yaml", dump(active))
    _note(folder, active)
    return active


def history(folder: Path) -> tuple[ActiveDocument, ...]:
    """Read all activations of a cell, oldest first."""
    past = [ActiveDocument.model_validate_json(line)
            for line in read_json_lines(folder / HISTORY)]
    now = read_active(folder)
    return tuple(past if now in past[-1:] else [*past, now])


def rollback(folder: Path, set_id: str | None = None, *, by: str, at: str,
             reason: str = "") -> ActiveDocument:
    """Go back to an earlier set, by default the one before.

    Raises:
        DocumentError: there is none, or robot or sensor have been exchanged since.
    """
    now = read_active(folder)
    wanted = set_id or now.previous
    if wanted is None:
        raise DocumentError("there is no set before the active one", source=str(folder))
    if _serials(folder, wanted) != _serials(folder, now.set):
        raise DocumentError(f"the set {wanted} belongs to another robot or sensor (serials "
                            f"{_serials(folder, wanted)}; now {_serials(folder, now.set)})",
                            source=str(folder))
    return activate(folder, wanted, by=by, at=at, reason=reason or f"back from {now.set}")


def _serials(folder: Path, set_id: str) -> tuple[str | None, ...]:
    found = read_set(folder, set_id)
    hand_eye = parse(HandEyeDocument, found.texts["hand_eye"], found.sources["hand_eye"])
    sensor = parse(SensorDocument, found.texts["sensor"], found.sources["sensor"])
    return hand_eye.robot.serial, sensor.serial


def _note(folder: Path, active: ActiveDocument) -> None:
    """Append an activation unless it is the last line; a crash between two steps is made good."""
    line = json.dumps(active.model_dump())
    if line not in read_json_lines(folder / HISTORY)[-1:]:
        append_line(folder / HISTORY, line)
