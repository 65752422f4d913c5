"""Lay a measured body onto its drawing, and tell a moved body from moved holes.

Whatever the method, the rigid part of all deviations is found apart from what is left of the holes:
forty holes that are all off by the same motion are one fact, not forty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cell.core.documents.job import Alignment
from cell.core.documents.nominals import Hole
from cell.core.geometry import Array, Transform
from cell.metrology.judge.datum import (
    Datum,
    Registration,
    UndeterminedError,
    solve_body_registration,
)

LEAST_SIGMA = 1e-3  # mm; a weight is never larger
LEAST_HOLES = 4  # for the rigid part: with three nothing would be left over


@dataclass(frozen=True, eq=False)
class Placed:
    """A measured hole: `centre` (3,) mm and its `covariance` (3, 3), as the fixture holds it."""

    hole: Hole
    centre: Array
    covariance: Array

    def datum(self, axes: str) -> Datum:
        """This hole as a datum that holds the body along `axes`."""
        x, y, z = np.sqrt(np.diag(self.covariance)).clip(min=LEAST_SIGMA)
        return Datum(self.hole.id, self.hole.centre, self.centre, axes, (x, y, z))


@dataclass(frozen=True, eq=False)
class Aligned:
    """How the body lies on the drawing.

    `aligned_from_body` carries measured points onto it; `registration` is None as the fixture holds
    the body. `problem` says why the body cannot be aligned. `moved` (mm) is the largest motion of a
    hole in the rigid part; `summary` has plain values for records and reports.
    """

    aligned_from_body: Transform
    registration: Registration | None
    problem: str
    moved: float
    summary: dict[str, Any]

    def covariance(self, point_in_body: Array, of_measuring: Array) -> Array:
        """Carry the covariance (3, 3) of a measured point (3,) along, the alignment's added.

        What datums and point have in common is counted twice: the sum is on the safe side.
        """
        turn = self.aligned_from_body.rotation
        carried = turn @ of_measuring @ turn.T
        if self.registration is None:
            return carried
        aligned = self.aligned_from_body @ point_in_body
        return carried + self.registration.predict_covariance(aligned)


def align_body(alignment: Alignment, placed: Sequence[Placed]) -> Aligned:
    """Align the measured holes of one body as its job says."""
    rigid = _rigid_part(placed)
    missing = sorted(set(alignment.datums) - {place.hole.id for place in placed})
    try:
        registration = _register(alignment, placed, missing)
    except UndeterminedError as problem:
        return Aligned(Transform.identity(), None, str(problem), 0.0,
                       {"method": alignment.method, "problem": str(problem)})
    aligned_from_body = (registration.body_from_measured if registration else Transform.identity())
    moved = _largest_motion(registration or rigid, placed)
    summary = {"method": alignment.method, "missing": missing} | _describe(registration)
    summary |= _describe_rigid_part(rigid, placed)
    summary["statement"] = (_moved_body(moved, alignment.limit_mm)
                            or _stray_datum(registration, alignment.limit_mm))
    return Aligned(aligned_from_body, registration, "", moved, summary)


def check_alignment(alignment: Alignment, holes: Sequence[Hole]) -> None:
    """Refuse datums that could not hold the body even if every hole lay on its nominal.

    Raises:
        UndeterminedError: says which motion they leave free.
    """
    ideal = [Placed(hole, hole.centre, 0.01 * np.eye(3)) for hole in holes]
    _register(alignment, ideal, ())


def _register(alignment: Alignment, placed: Sequence[Placed],
              missing: Sequence[str]) -> Registration | None:
    if alignment.method == "fixture":
        return None
    datums = [place.datum(axes) for place in placed
              if (axes := _axes(alignment, place.hole.id))]
    try:
        return solve_body_registration(datums, Transform.identity())
    except UndeterminedError as loose:
        without = f" without {', '.join(missing)}, not measured" if missing else ""
        raise UndeterminedError(f"{loose}{without}") from None


def _axes(alignment: Alignment, hole_id: str) -> str:
    """The axes that a hole holds: as listed for 3-2-1, all three for a best fit."""
    if hole_id not in alignment.datums:
        return ""
    return "xyz" if alignment.method == "best_fit" else alignment.datums[hole_id]


def _rigid_part(placed: Sequence[Placed]) -> Registration | None:
    """Best fit of all measured holes; None where they are too few or in line."""
    if len(placed) < LEAST_HOLES:
        return None
    try:
        return solve_body_registration([place.datum("xyz") for place in placed],
                                       Transform.identity(), leave_out=False)
    except UndeterminedError:
        return None


def _largest_motion(registration: Registration | None, placed: Sequence[Placed]) -> float:
    if registration is None or not placed:
        return 0.0
    centres = np.array([place.centre for place in placed])
    motions = registration.body_from_measured @ centres - centres
    return float(np.linalg.norm(motions, axis=1).max())


def _describe(registration: Registration | None) -> dict[str, Any]:
    if registration is None:
        return {}
    return {"aligned_from_body": registration.body_from_measured.matrix.tolist(),
            "residuals_mm": registration.residuals, "rms_mm": registration.rms,
            "left_out_mm": registration.left_out, "redundancy": registration.redundancy}


def _describe_rigid_part(rigid: Registration | None, placed: Sequence[Placed]) -> dict[str, Any]:
    """Say by how much the body as a whole is off, and what is left of the holes without that."""
    if rigid is None:
        return {}
    gaps = np.array([place.centre - place.hole.centre for place in placed])
    body_from_nominal = rigid.measured_from_body
    shift = body_from_nominal @ rigid.pivot - rigid.pivot
    return {"rigid_shift_mm": shift.tolist(),
            "rigid_turn_deg": np.degrees(body_from_nominal.rotation_vector).tolist(),
            "rms_before_mm": float(np.sqrt(np.mean(gaps**2))), "rms_after_mm": rigid.rms}


def _moved_body(moved: float, limit: float) -> str:
    if moved <= limit:
        return ""
    return (f"the body, the base or the sensor moved: all holes together are off by up to "
            f"{moved:.2f} mm, more than the {limit:g} mm that the job allows")


def _stray_datum(registration: Registration | None, limit: float) -> str:
    """A datum that the others do not bear out carries the whole body with it."""
    misses = {name: miss for name, miss in (registration.left_out if registration else {}).items()
              if miss is not None}
    stray = max(misses, key=misses.__getitem__, default="")
    if not stray or misses[stray] <= limit:
        return ""
    return (f"the datum {stray} is off by {misses[stray]:.2f} mm from where the others put it, "
            f"more than the {limit:g} mm that the job allows: do not rely on the alignment")
