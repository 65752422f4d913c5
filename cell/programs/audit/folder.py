"""The audit of a folder of recordings: does every body follow the one before it?

Each seal names the one before by the hash of its bytes and carries a number. What is missing,
exchanged, doubled or out of place therefore shows; that the newest were removed does not: compare
the newest head with one that was kept elsewhere.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal, TypeAlias

from cell.recording.audit_picture import is_comparison
from cell.recording.seal import SUFFIX, Seal, read_seals, reference, seal_path

Kind: TypeAlias = Literal["missing", "reordered", "duplicated", "foreign", "unsealed"]


@dataclass(frozen=True)
class Finding:
    """One thing out of place: what it is, which file, and a sentence."""

    kind: Kind
    file: str
    words: str


@dataclass(frozen=True)
class FolderAudit:
    """The row of a folder: its recordings in order, what is out of place, the newest head.

    `head` is the sha256 of the newest seal: keep it elsewhere, and the row cannot be shortened.
    """

    folder: Path
    logs: tuple[Path, ...]
    findings: tuple[Finding, ...]
    newest: str | None
    head: str | None


def audit_folder(folder: Path) -> FolderAudit:
    """Walk a folder of recordings and their seals. Reads no recording."""
    seals = read_seals(folder)
    row = sorted(seals, key=lambda path: (seals[path].sequence, path.name))
    logs = tuple(path.with_name(seals[path].file) for path in row)
    findings = (*_unreadable(folder, seals), *_doubled(seals), *_gaps(row, seals),
                *_absent(row, logs), *_unsealed(folder, seals))
    newest = row[-1] if row else None
    return FolderAudit(folder, tuple(log for log in logs if log.exists()), findings,
                       newest.name if newest else None,
                       reference(newest).sha256 if newest else None)


def _unreadable(folder: Path, seals: Mapping[Path, Seal]) -> Iterator[Finding]:
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        if path not in seals:
            yield Finding("foreign", path.name, "is not a seal")
        elif path != seal_path(path.with_name(seals[path].file)):
            yield Finding("foreign", path.name, f"is the seal of {seals[path].file}")


def _doubled(seals: Mapping[Path, Seal]) -> Iterator[Finding]:
    """Two seals of one number, or one recording under two names."""
    alike: defaultdict[tuple[str, object], list[str]] = defaultdict(list)
    for path, seal in seals.items():
        alike["number", seal.sequence].append(path.name)
        if seal.original is None:
            alike["content", seal.chain].append(path.name)
            alike["recording id", seal.recording_id].append(path.name)
    for (what, _), names in alike.items():
        yield from (Finding("duplicated", name, f"has the {what} of {names[0]}")
                    for name in names[1:])


def _gaps(row: list[Path], seals: Mapping[Path, Seal]) -> Iterator[Finding]:
    """Each seal must name the one before it in the row."""
    absent = seals[row[0]].previous if row else None
    if absent is not None:
        yield Finding("missing", absent.file, f"comes before {row[0].name}")
    for before, path in pairwise(row):
        seal, earlier = seals[path], seals[before]
        if seal.previous is None:
            yield Finding("foreign", path.name, "begins a row of its own")
        elif seal.sequence > earlier.sequence + 1:
            yield Finding("missing", seal.previous.file,
                          f"comes before {path.name}, as number {seal.sequence - 1}")
        elif seal.previous != reference(before):
            yield Finding("reordered", path.name, f"follows {seal.previous.file} as it was, "
                          f"not {before.name} as it is")
        elif seal.sealed < earlier.sealed:
            yield Finding("reordered", path.name, f"was sealed before {before.name}")


def _absent(row: list[Path], logs: tuple[Path, ...]) -> Iterator[Finding]:
    for path, log in zip(row, logs, strict=True):
        if not log.exists():
            yield Finding("missing", log.name, f"its seal {path.name} is here")


def _unsealed(folder: Path, seals: Mapping[Path, Seal]) -> Iterator[Finding]:
    """Recordings that no seal knows; one that a repaired copy was made from is known."""
    known = {seal.file for seal in seals.values()}
    known |= {seal.original.file for seal in seals.values() if seal.original is not None}
    for path in sorted(folder.glob("*.rrd")):
        if path.name not in known and not is_comparison(path):
            yield Finding("unsealed", path.name, "has no seal: a run that died, or a stranger")
