"""The volume that is measured in, and how far an uncertain camera carries its points wrongly."""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Transform
from cell.metrology.motions import point_shift

VOLUME: Array = np.array([[x, y, z] for x in (-40.0, 0.0, 40.0) for y in (-30.0, 0.0, 30.0)
                          for z in (-20.0, 0.0, 20.0)])
"""The working volume (mm) about the point on the optic axis at the working distance."""


def point_sigma(covariance: Array, carrier_from_camera: Transform,
                working_distance: float) -> float:
    """Carry a nudge's covariance (6, 6) to the working volume: mm, rms in 3D."""
    jacobian = volume_shift(carrier_from_camera, working_distance)
    return float(np.sqrt(np.einsum("nij,jk,nik->", jacobian, covariance, jacobian) / len(VOLUME)))


def volume_shift(carrier_from_camera: Transform, working_distance: float) -> Array:
    """Build (n, 3, 6): how the points of the working volume move with a nudge of the camera."""
    in_camera = VOLUME + np.array([0.0, 0.0, working_distance])
    return point_shift(carrier_from_camera.turn(in_camera))
