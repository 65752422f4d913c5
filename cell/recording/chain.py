"""The hash chain: each link is the hash of the link before and of everything audited since.

    link 0        the start record, its papers by their hash
    link k        the k-th hole, its images by the hash of their pixels
    the head      the stop record

An image may be removed later and the chain still holds; a number, a paper, a hole may not.
"""

from __future__ import annotations

import hashlib

from cell.recording.forms import canonical

NOTHING = ""
"""What the first link hangs on."""


def link(previous: str, plain: object) -> str:
    """Extend the chain by plain values and return the new link (sha256, hexadecimal)."""
    return hashlib.sha256(previous.encode() + b"\n" + canonical(plain)).hexdigest()


def text_hash(text: str) -> str:
    """Hash the exact text of a paper."""
    return hashlib.sha256(text.encode()).hexdigest()
