"""The seal of a recording: a small file beside it that says what was closed, when and by whom.

Tamper-evident, not tamper-proof. An edited, cut or exchanged recording no longer fits its seal; a
signed seal cannot be rewritten without the key; a seal names the one before it, so that a removed
or exchanged body leaves a gap. It does not protect against someone who holds both the key and the
disk, nor show that the newest bodies were removed: for that, keep the newest head elsewhere.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from pydantic import AfterValidator, Field, ValidationError

from cell.core.documents.base import Document
from cell.core.errors import DocumentError, RecordingError
from cell.recording.forms import canonical
from cell.recording.framing import check_file
from cell.recording.keys import key_id, public_text

SUFFIX = ".seal.json"


def _in_this_folder(name: str) -> str:
    if name in ("", ".", "..") or "/" in name or "\0" in name:
        raise ValueError("expected the name of a file in the same folder")
    return name


FileName: TypeAlias = Annotated[str, AfterValidator(_in_this_folder)]


class Reference(Document):
    """Another file by its name and the sha256 of its bytes."""

    file: FileName
    sha256: str


class Seal(Document):
    """What a seal says. `sequence` counts the seals of a folder; `original` is what a repaired or
    pruned copy was made from; without a key the seal is made of hashes only.
    """

    format: Literal[1] = 1
    file: FileName
    size: int
    sha256: str
    chain: str
    holes: Annotated[int, Field(ge=0)]
    status: Literal["complete", "aborted", "interrupted", "fault", "repaired", "pruned"]
    recording_id: str
    sealed: str
    versions: dict[str, str]
    sequence: Annotated[int, Field(ge=1)]
    previous: Reference | None = None
    original: Reference | None = None
    key: str | None = None
    public_key: str | None = None
    signature: str | None = None

    @property
    def signed_bytes(self) -> bytes:
        """The bytes that the signature is made over: everything but the signature."""
        return canonical(self.model_dump(exclude={"signature"}))


@dataclass(frozen=True)
class Closed:
    """What is sealed: the head of the chain, the holes, how it ended, with what it was made."""

    chain: str
    holes: int
    status: str
    recording_id: str
    versions: Mapping[str, str] = field(default_factory=dict)
    original: Reference | None = None


def seal_path(log: Path) -> Path:
    """Return where the seal of a recording lies."""
    return log.with_name(log.name + SUFFIX)


@contextmanager
def sealed_or_removed(copy: Path) -> Iterator[None]:
    """Leave no copy that is not whole and sealed: it would pass for one that was made before.

    A DocumentError is about what was there already, which stays.
    """
    try:
        yield
    except BaseException as failure:
        if not isinstance(failure, DocumentError):
            with suppress(OSError):
                copy.unlink()
        raise


def write_seal(log: Path, closed: Closed, key: Ed25519PrivateKey | None) -> Seal:
    """Seal a closed recording, linked to the newest seal of its folder.

    Raises:
        RecordingError: it is sealed already, or the disk failed.
    """
    try:
        with _locked(log.parent):
            seal = _signed(_unsigned(log, closed, newest_seal(log.parent)), key)
            _write_new(seal_path(log), canonical(seal.model_dump()) + b"\n")
    except FileExistsError:
        raise RecordingError(f"{log}: is sealed already; a seal is never overwritten") from None
    except OSError as error:
        raise RecordingError(f"{log}: cannot be sealed: {error.strerror}") from error
    return seal


def read_seal(path: Path) -> Seal:
    """Read a seal.

    Raises:
        DocumentError: it cannot be read, or is no seal.
    """
    check_file(path)
    try:
        return Seal.model_validate_json(path.read_bytes())
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    except ValidationError as error:
        first = error.errors()[0]
        raise DocumentError(f"is not a seal: {first['msg']}", source=str(path),
                            place=".".join(map(str, first["loc"]))) from None


def reference(path: Path) -> Reference:
    """Name a file with the hash of its bytes.

    Raises:
        DocumentError: it cannot be read.
    """
    check_file(path)
    try:
        with path.open("rb") as file:
            return Reference(file=path.name, sha256=hashlib.file_digest(file, "sha256").hexdigest())
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None


def newest_seal(folder: Path) -> Path | None:
    """Find the seal with the highest number; one that cannot be read does not count."""
    seals = [entry for entry in os.scandir(folder)
             if entry.name.endswith(SUFFIX) and entry.is_file()]
    numbered = sorted((_number(entry.path, entry.stat().st_mtime_ns), entry.path)
                      for entry in seals)
    return next((Path(path) for _, path in reversed(numbered) if _is_seal(Path(path))), None)


@lru_cache(maxsize=100_000)
def _number(seal: str, _changed: int) -> int:
    """Read a seal's number, once: every body of a shift asks it of all bodies before."""
    path = Path(seal)
    try:
        return int(json.loads(path.read_bytes())["sequence"])
    except (OSError, ValueError, LookupError, TypeError):
        return 0


def _is_seal(path: Path) -> bool:
    try:
        read_seal(path)
    except DocumentError:
        return False
    return True


def read_seals(folder: Path) -> dict[Path, Seal]:
    """Read all seals of a folder, leaving out what is none."""
    seals = {}
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        try:
            seals[path] = read_seal(path)
        except DocumentError:
            continue  # named by the audit of the folder, where it breaks the link
    return seals


def _unsigned(log: Path, closed: Closed, previous: Path | None) -> Seal:
    file = reference(log)
    return Seal(
        file=file.file, size=log.stat().st_size, sha256=file.sha256, chain=closed.chain,
        holes=closed.holes, status=closed.status,  # type: ignore[arg-type]  # pydantic checks it
        recording_id=closed.recording_id, versions=dict(closed.versions),
        sealed=datetime.now(UTC).isoformat(timespec="seconds"),
        sequence=1 if previous is None else read_seal(previous).sequence + 1,
        previous=None if previous is None else reference(previous), original=closed.original)


def _signed(seal: Seal, key: Ed25519PrivateKey | None) -> Seal:
    if key is None:
        return seal
    public = key.public_key()
    named = seal.model_copy(update={"key": key_id(public), "public_key": public_text(public)})
    return named.model_copy(update={"signature": key.sign(named.signed_bytes).hex()})


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let one process at a time append to the row of seals."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_new(path: Path, content: bytes) -> None:
    """Write a file that was not there, whole or not at all."""
    half = path.with_name(path.name + ".part")
    with half.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    try:
        os.link(half, path)
    finally:
        half.unlink()
    path.chmod(0o444)
