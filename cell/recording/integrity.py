"""Whether a recording is as it was closed: what was checked, what was not, and why."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from cell.core.errors import DocumentError
from cell.recording.keys import is_signed_by, key_id, parse_public_key
from cell.recording.seal import Closed, Seal, read_seal, reference, seal_path

COPIES = ("repaired", "pruned")  # seals of copies name what was done to them


@dataclass(frozen=True)
class Check:
    """One level of the integrity: `passed`, failed, or (None) not checked; `words` say it."""

    level: str
    passed: bool | None
    words: str


def check_seal(log: Path, trusted: Collection[str] = ()) -> tuple[Seal | None, list[Check]]:
    """Check a recording against its seal: the file, the signature, the link to the one before.

    Args:
        log: the recording.
        trusted: the ids of keys that are known here; with none, a signature shows no more than
            the id of its key.

    Raises:
        DocumentError: the recording cannot be read.
    """
    path = seal_path(log)
    if not os.path.lexists(path):
        return None, [Check("seal", None, "unsealed: there is no seal beside it (of a run that "
                                          "died, `cell repair` seals what is whole)")]
    try:
        seal = read_seal(path)
    except DocumentError as error:
        return None, [Check("seal", False, str(error))]
    return seal, [_check_file(log, seal), _check_signature(seal, trusted), _check_link(log, seal)]


def check_chain(seal: Seal | None, found: Closed, faults: Sequence[str]) -> Check:
    """Check what was recomputed from the content against what was written and sealed.

    Args:
        seal: the recording's seal, if it has one.
        found: the same of the recording itself: the last link of its chain, whole holes.
        faults: what is not as it was written.
    """
    if faults:
        return Check("chain", False, "; ".join(faults))
    if seal is None:
        return Check("chain", True, f"{found.holes} holes follow from the start record; nothing "
                                    "sealed says that they are all")
    if (seal.chain, seal.holes) != (found.chain, found.holes):
        return Check("chain", False, f"the seal closes {seal.holes} holes and another content")
    if seal.recording_id != found.recording_id:
        return Check("chain", False, f"this is the recording {found.recording_id}; the seal closes "
                                     f"{seal.recording_id}")
    if seal.status not in (found.status, *COPIES):
        return Check("chain", False, f"the run ended {found.status}; the seal says {seal.status}")
    if seal.status in COPIES and seal.original is None:
        return Check("chain", False, f"the seal says {seal.status}, but not of which recording")
    return Check("chain", True, f"start, {found.holes} holes and end follow from each other")


def check_images(seal: Seal | None, missing: int) -> Check:
    """Say whether the pixels were there to be compared with their hashes."""
    if not missing:
        return Check("images", True, "the pixels of every image fit their hash")
    if seal is not None and seal.status != "pruned":
        return Check("images", False, f"{missing} images are missing, and the seal does not say "
                                      "that they were pruned")
    return Check("images", None, f"{missing} images were pruned: their hashes are in the chain,"
                                 " the pixels cannot be measured again")


def _check_file(log: Path, seal: Seal) -> Check:
    found = reference(log)
    if found.sha256 != seal.sha256:
        return Check("file", False, "altered: its sha256 is not the sealed one")
    if found.file != seal.file:
        return Check("file", False, f"was sealed under the name {seal.file}")
    return Check("file", True, f"{seal.size} bytes as sealed on {seal.sealed}")


def _check_signature(seal: Seal, trusted: Collection[str]) -> Check:
    if seal.signature is None:
        return Check("signature", False if trusted else None,
                     "none: the seal is made of hashes only, anyone can make another")
    key = _signing_key(seal)
    if key is None:
        return Check("signature", False, "the seal was altered: its signature does not fit")
    name = key_id(key)
    if name in trusted:
        return Check("signature", True, f"by the known key {name}")
    return Check("signature", False if trusted else None,
                 f"by the key {name}, which is not known here: compare it with the cell's")


def _signing_key(seal: Seal) -> Ed25519PublicKey | None:
    """Take the key out of a seal whose signature is its own; None where it is not."""
    key = parse_public_key(seal.public_key or "")
    try:
        signature = bytes.fromhex(seal.signature or "")
    except ValueError:
        return None
    fits = key is not None and key_id(key) == seal.key and is_signed_by(key, signature,
                                                                        seal.signed_bytes)
    return key if fits else None


def _check_link(log: Path, seal: Seal) -> Check:
    if seal.previous is None:
        return Check("link", True, "the first seal of its folder")
    previous = log.with_name(seal.previous.file)
    if not os.path.lexists(previous):
        return Check("link", None, f"the seal before it, {previous.name}, is not here")
    if not previous.is_file() or reference(previous) != seal.previous:
        return Check("link", False, f"the seal before it, {previous.name}, is another one now")
    return Check("link", True, f"follows {previous.name}")
