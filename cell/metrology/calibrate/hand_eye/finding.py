"""One thing found of a hand-eye session, and how grave it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from cell.metrology.calibrate.gates import Ruling, worst


@dataclass(frozen=True)
class Finding:
    """One cause: a short code, how grave it is, and a sentence with the evidence."""

    code: str
    verdict: Literal["warn", "refuse"]
    sentence: str


def ruled_worst(findings: Iterable[Finding]) -> Ruling:
    """Say whether any finding refuses, or warns."""
    return worst(finding.verdict for finding in findings)
