"""The key that seals are signed with: Ed25519, the private half readable by its owner alone.

It lies outside of `logs/`: who can write the recordings should not hold the key that vouches for
them. The environment variable `CELL_SEAL_KEY` names another place.
"""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from cell.core.errors import DocumentError

ENVIRONMENT = "CELL_SEAL_KEY"


def key_path() -> Path:
    """Return where the private key of this account lies, or would lie."""
    named = os.environ.get(ENVIRONMENT)
    if named:
        return Path(named)
    try:
        home = Path.home()
    except RuntimeError:  # a user id without an account, as in a container
        home = Path("/")
    return home / ".config" / "cell" / "seal.key"


def new_key(path: Path) -> Ed25519PrivateKey:
    """Make a key and write it where none is; the public half goes beside it (`.pub`).

    Raises:
        DocumentError: a key is there already, or the place cannot be written.
    """
    key = Ed25519PrivateKey.generate()
    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with os.fdopen(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "wb") as file:
            file.write(private)
        public_path(path).write_bytes(public_text(key.public_key()).encode())
    except FileExistsError:
        raise DocumentError("a key is there already; move it away first: what it signed is "
                            "checked with its public half", source=str(path)) from None
    except OSError as error:
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None
    return key


def public_path(path: Path) -> Path:
    """Return where the public half of a key lies: this file may be given to anyone."""
    return path.with_suffix(".pub")


def read_key(path: Path) -> Ed25519PrivateKey | None:
    """Read the private key; None where there is none.

    Raises:
        DocumentError: others than its owner can read it, or it is no Ed25519 key.
    """
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        text = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    if mode & 0o077:
        raise DocumentError(f"others can use this key (mode {mode:04o}); expected 0600: "
                            f"chmod 600 {path}", source=str(path))
    try:
        key = load_pem_private_key(text, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        key = None
    if not isinstance(key, Ed25519PrivateKey):
        raise DocumentError("is not an unencrypted Ed25519 private key (PEM)", source=str(path))
    return key


def read_public_key(path: Path) -> Ed25519PublicKey:
    """Read a public key from a PEM file.

    Raises:
        DocumentError: it cannot be read or is no Ed25519 public key.
    """
    try:
        key = parse_public_key(path.read_text())
    except (OSError, UnicodeDecodeError) as error:
        raise DocumentError(f"cannot be read: {error}", source=str(path)) from None
    if key is None:
        raise DocumentError("is not an Ed25519 public key (PEM)", source=str(path))
    return key


def parse_public_key(text: str) -> Ed25519PublicKey | None:
    """Parse a public key from PEM; None where it is none."""
    try:
        key = load_pem_public_key(text.encode())
    except (ValueError, UnsupportedAlgorithm):
        return None
    return key if isinstance(key, Ed25519PublicKey) else None


def public_text(key: Ed25519PublicKey) -> str:
    """Write a public key as PEM."""
    return key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo).decode()


def key_id(key: Ed25519PublicKey) -> str:
    """Return the name of a key: the first 16 hexadecimal digits of the hash of its public half."""
    return hashlib.sha256(key.public_bytes(Encoding.Raw, PublicFormat.Raw)).hexdigest()[:16]


def is_signed_by(key: Ed25519PublicKey, signature: bytes, message: bytes) -> bool:
    """Tell whether `signature` is that of `key` over `message`."""
    try:
        key.verify(signature, message)
    except InvalidSignature:
        return False
    return True
