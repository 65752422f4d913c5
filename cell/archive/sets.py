"""Calibration sets: immutable folders, one of them active, changed in one step, never silently.

The folder of a cell, `calibration/<cell>/`:

    cell.yaml
    sets/<id>/          sensor.yaml, hand_eye.yaml, perhaps kinematics.yaml, views, pictures
        set.yaml        its version, and the SHA-256 of every file of the set
    active.yaml         which set, since when, by whom, and which one before
    history.jsonl       every activation, one line each
    body/<job>.yaml     the body registration
    offsets/<job>.yaml  the CMM correlation offsets
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cell.archive.files import read_text, replace_text, sync
from cell.core.documents.base import Document
from cell.core.documents.calibration import ActiveDocument, HandEyeDocument, SensorDocument
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError

CALIBRATION = Path("calibration")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
MANIFEST = "set.yaml"


class SetDocument(Document):
    """`set.yaml`: what the set consists of, so that a change shows."""

    version: Literal[1] = 1
    created: str
    files: dict[str, str]


@dataclass(frozen=True)
class SetTexts:
    """The documents of one set, as text by name, and the file of each."""

    texts: Mapping[str, str]
    sources: Mapping[str, str]


def cell_folder(calibration: Path, cell: str) -> Path:
    """Find the folder of a cell; DocumentError where there is none."""
    folder = calibration / _plain(cell, "a cell", str(calibration))
    if not folder.is_dir():
        known = sorted(file.parent.name for file in calibration.glob("*/cell.yaml"))
        raise DocumentError(f"there is no cell {cell!r}; known: {', '.join(known) or 'none'}",
                            source=str(calibration))
    return folder


def active_set(folder: Path) -> str:
    """Read which set of a cell is active."""
    return read_active(folder).set


def read_active(folder: Path) -> ActiveDocument:
    """Read `active.yaml` of a cell."""
    file = folder / "active.yaml"
    active = parse(ActiveDocument, read_text(file), str(file))
    _plain(active.set, "a set", str(file))
    return active


def read_set(folder: Path, set_id: str) -> SetTexts:
    """Read the documents of a set, unchanged since they were made.

    Raises:
        DocumentError: no such set, a document is missing, or a file differs from its hash.
    """
    home = folder / "sets" / _plain(set_id, "a set", str(folder))
    if not home.is_dir():
        raise DocumentError(f"there is no set {set_id!r}; known: {', '.join(list_sets(folder))}",
                            source=str(folder / "sets"))
    check_set(home)
    files = {name: home / f"{name}.yaml" for name in ("sensor", "hand_eye")}
    if (home / "kinematics.yaml").exists():
        files["kinematics"] = home / "kinematics.yaml"
    return SetTexts({name: read_text(file) for name, file in files.items()},
                    {name: str(file) for name, file in files.items()})


def list_sets(folder: Path) -> list[str]:
    """List the ids of a cell's sets, oldest first (ids begin with their time)."""
    return sorted(path.name for path in (folder / "sets").glob("*/") if NAME.fullmatch(path.name))


def check_set(home: Path) -> None:
    """Compare every file of a set with its hash, where the set has a manifest."""
    manifest = home / MANIFEST
    if not manifest.exists():
        return
    document = parse(SetDocument, read_text(manifest), str(manifest))
    for file in home.glob("*.yaml"):
        if file.name not in document.files and file.name != MANIFEST:
            raise DocumentError(f"added since the set was made on {document.created}: sets are "
                                "immutable, make a new one", source=str(file))
    for name, expected in document.files.items():
        file = home / name
        if not file.resolve().is_relative_to(home.resolve()) or not file.is_file():
            raise DocumentError("a file of the set is missing", source=str(file))
        if _sha256(file) != expected:
            raise DocumentError(f"changed since the set was made on {document.created}: sets are "
                                "immutable, make a new one", source=str(file))


def write_set(folder: Path, made: Path, created: str) -> str:
    """Make a set of all files in the folder `made`, which it takes over; return the new id.

    Args:
        folder: the cell's folder.
        made: a folder on the same disk, with `sensor.yaml`, `hand_eye.yaml` and what belongs to
            them.
        created: the time (UTC) as 2026-11-22T0955Z; the id is that and a hash of the contents.

    Raises:
        DocumentError: a document of it is wrong, or the disk refuses.
    """
    for name, model in (("sensor", SensorDocument), ("hand_eye", HandEyeDocument)):
        parse(model, read_text(made / f"{name}.yaml"), str(made / f"{name}.yaml"))
    files = sorted(path for path in made.rglob("*") if path.is_file() and path.name != MANIFEST)
    hashes = {str(path.relative_to(made)): _sha256(path) for path in files}
    digest = hashlib.sha256(json.dumps(hashes).encode()).hexdigest()
    set_id = _plain(f"{created}_{digest[:6]}", "a set", str(folder))
    replace_text(made / MANIFEST, dump(SetDocument(created=created, files=hashes)))
    for path in files:
        path.chmod(0o444)
        sync(path)
    home = folder / "sets" / set_id
    try:
        home.parent.mkdir(exist_ok=True)
        made.rename(home)
        sync(home.parent)
    except OSError as error:
        raise DocumentError(f"the set cannot be kept: {error.strerror}", source=str(home)) from None
    return set_id


def _plain(name: str, what: str, source: str) -> str:
    """Refuse a name that could lead out of its folder."""
    if not NAME.fullmatch(name):
        raise DocumentError(f"{name!r} does not name {what}: expected letters, digits, '.', '_' "
                            "or '-'", source=source)
    return name


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
