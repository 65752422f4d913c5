"""The light plane in the camera frame, from the stripe on a flat board in several poses.

Rays through the stripe's centres meet the board; one plane is laid through all points by robust
total least squares. Points of one pose share the error of its board pose, so that the covariance
comes from leaving out one pose after the other (jackknife), not from the number of points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel
from cell.metrology.spread import robust_sigma, tukey_weights

FEWEST_POSES = 4
ROUNDS = 10
FLAT = 0.02  # of the longer extent: stripes that spread less lie on one line


@dataclass(frozen=True, eq=False)
class StripeOnBoard:
    """The stripe in one pose of the board: its centres `pixels` (n, 2), and where the board was."""

    pixels: Array
    camera_from_board: Transform

    def meet(self, camera: CameraModel) -> Array:
        """Intersect the stripe's rays with the board: points (n, 3) in the camera frame."""
        board = Plane.through(self.camera_from_board.translation,
                              self.camera_from_board.rotation[:, 2])
        return board.meet(camera.rays(self.pixels))


@dataclass(frozen=True, eq=False)
class LightPlaneResult:
    """The light plane; `covariance` (4, 4) of its unit normal and offset.

    `residuals` are the distances (n,) mm of each pose's points from the plane, `left_out` (poses,)
    how far (mm, rms) each pose is from the plane of the others, `depths` the range that was seen.
    """

    plane: Plane
    covariance: Array
    residuals: tuple[Array, ...]
    left_out: Array
    depths: tuple[float, float]

    @property
    def rms(self) -> float:
        """The distance of the points from the plane, root mean square (mm)."""
        return _rms(np.concatenate(self.residuals))

    @property
    def left_out_rms(self) -> float:
        """How far poses are missed that were not fitted, root mean square (mm)."""
        return _rms(self.left_out)

    @property
    def normal_sigma(self) -> float:
        """The largest standard uncertainty (rad) of the normal's direction."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))


def solve_light_plane(stripes: Sequence[StripeOnBoard], camera: CameraModel) -> LightPlaneResult:
    """Solve the plane from the stripe on a board in four poses or more.

    Raises:
        UnmeasurableError: `too_few_poses`; `one_line`, where the poses do not differ in depth or
            tilt, so that the stripes hardly span a plane.
    """
    if len(stripes) < FEWEST_POSES:
        raise UnmeasurableError("too_few_poses", f"{len(stripes)} board poses with a stripe; "
                                                 f"{FEWEST_POSES} are needed")
    points = [stripe.meet(camera) for stripe in stripes]
    plane = _fit(np.concatenate(points))
    others = [_fit(np.concatenate(points[:i] + points[i + 1:])) for i in range(len(points))]
    depths = np.concatenate(points)[:, 2]
    return LightPlaneResult(
        plane, _jackknife(plane, others), tuple(plane.distance(some) for some in points),
        np.array([_rms(other.distance(some)) for other, some in zip(others, points, strict=True)]),
        (float(depths.min()), float(depths.max())))


def _fit(points: Array) -> Plane:
    """Lay a plane through points by total least squares, Tukey's weights; it faces the camera."""
    plane = _fit_weighted(points, np.ones(len(points)))
    for _ in range(ROUNDS):
        misses = plane.distance(points)
        weights = tukey_weights(misses, max(1e-6, robust_sigma(misses)))
        plane = _fit_weighted(points, np.maximum(weights, 1e-9))
    return plane


def _fit_weighted(points: Array, weights: Array) -> Plane:
    middle = np.average(points, axis=0, weights=weights)
    _, spread, axes = np.linalg.svd((points - middle) * np.sqrt(weights)[:, None],
                                    full_matrices=False)
    if spread[1] < FLAT * spread[0]:
        raise UnmeasurableError("one_line", "the stripes lie on one line: change the distance and "
                                            "the tilt of the board")
    return Plane.through(middle, axes[2] * np.sign(axes[2] @ middle))


def _jackknife(plane: Plane, others: Sequence[Plane]) -> Array:
    """Tukey's estimate from the fits that each leave out one pose."""
    off = np.array([np.append(other.normal - plane.normal, other.offset - plane.offset)
                    for other in others])
    off = off - off.mean(axis=0)
    return (len(others) - 1) / len(others) * off.T @ off


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values ** 2)))
