"""Whether the views differ enough in orientation, and which motion is missing where they do not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array
from cell.metrology.calibrate.hand_eye.start import pairs
from cell.metrology.motions import rotation_vectors

AXES = ("x", "y", "z")
ENOUGH_TILT, ENOUGH_ROLL = 25.0, 60.0  # degrees


@dataclass(frozen=True, eq=False)
class Diversity:
    """How the orientations spread: degrees, and the axes of the rotations between the views.

    `axis_spread` is the second singular value of all pairs' rotation vectors over the first,
    `principal_deg` (3,) the root mean square turn about the principal axes, largest first, and
    `turns_deg` (3,) that about the camera's x, y and z.
    """

    tilt_range_deg: float
    roll_range_deg: float
    axis_spread: float
    principal_deg: Array
    turns_deg: Array

    @property
    def missing(self) -> str:
        """Say which motion is missing, as an operator would make it; empty if none is."""
        wanted = []
        if self.tilt_range_deg < ENOUGH_TILT:
            axis = AXES[int(np.argmin(self.turns_deg[:2]))]
            wanted.append(f"tilt about the camera's {axis} by 20 degrees, both ways (now "
                          f"{self.turns_deg[AXES.index(axis)]:.0f})")
        if self.roll_range_deg < ENOUGH_ROLL:
            wanted.append(f"roll about the optic axis by 60 degrees (now "
                          f"{self.roll_range_deg:.0f})")
        return ", then ".join(wanted)


def measure_diversity(camera_from_board: Array) -> Diversity:
    """Measure how far the orientations (n, 4, 4) spread."""
    _, motions = pairs(camera_from_board, camera_from_board)
    turns = rotation_vectors(motions)
    strengths = np.linalg.svd(turns, compute_uv=False)
    return Diversity(_tilt_range(camera_from_board), _roll_range(camera_from_board),
                     float(strengths[1] / max(strengths[0], 1e-12)),
                     np.degrees(strengths / np.sqrt(len(turns))),
                     np.degrees(np.sqrt(np.mean(turns ** 2, axis=0))))


def _tilt_range(camera_from_board: Array) -> float:
    """The largest angle (degrees) between any two board normals, as the camera sees them."""
    normals = camera_from_board[:, :3, 2]
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0)).max()))


def _roll_range(camera_from_board: Array) -> float:
    """The arc (degrees) that holds all turns about the optic axis."""
    first = camera_from_board[0, :3, :3]
    quaternions = Rotation.from_matrix(camera_from_board[:, :3, :3] @ first.T).as_quat()
    rolls = np.sort(2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3]) % (2.0 * np.pi))
    gaps = np.diff(np.concatenate([rolls, [rolls[0] + 2.0 * np.pi]]))
    return float(np.degrees(2.0 * np.pi - gaps.max()))
