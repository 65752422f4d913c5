"""The master check: a body that a CMM knows says whether the cell still measures right."""

from __future__ import annotations

from dataclasses import dataclass

from cell.core.documents.result import BodyResult


@dataclass(frozen=True)
class MasterFinding:
    """What a master check found: `worst` mm at `where`, and the holes that were not measured."""

    passed: bool
    worst: float
    where: str
    missing: tuple[str, ...]

    def __str__(self) -> str:
        if self.missing:
            return f"master check: not measured: {', '.join(self.missing)}"
        return (f"master check {'passed' if self.passed else 'failed'}: "
                f"{self.worst:.3f} mm at {self.where}")


def judge_master(result: BodyResult | None, limit: float) -> MasterFinding:
    """Judge a master: every hole measured, and nothing further than `limit` mm from what a CMM
    measured on it; from the nominals where no CMM has measured any hole.
    """
    features = result.features if result else ()
    known = any(feature.bias for feature in features)
    missing = tuple(feature.id for feature in features if feature.verdict == "not_measured")
    errors = [(abs(error), f"{feature.id}.{axis}") for feature in features
              for axis, error in (feature.bias if known else feature.deviation or {}).items()]
    worst, where = max(errors, default=(float("inf"), "no hole"))
    return MasterFinding(worst <= limit and not missing, worst, where, missing)
