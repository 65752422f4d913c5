"""What a picture yields and what a plan expects: the words between detecting and locating.

All points are raw pixels (x, y) with centres at integers, as seen through the lens: undistorting
them is the first thing that locating does.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from cell.core.geometry import Array


@dataclass(frozen=True, eq=False)
class Expected:
    """What is known of a hole before looking, in the camera frame (mm, rad); None where nothing is.

    `normal` (3,) may point either way; `normal_sigma` is its standard deviation per tangent axis.
    `centre_sigma` (mm) says how far the hole may lie from `centre`.
    """

    centre: Array | None = None
    centre_sigma: float = 5.0
    normal: Array | None = None
    normal_sigma: float = 0.0061
    radius: float | None = None
    thickness: float | None = None


@dataclass(frozen=True, eq=False)
class Rim:
    """The rim of the hole on the face that the camera sees.

    `points` (n, 2) px on the edge, `directions` (n, 2) unit, from the metal into the hole.
    `sigma` px is the standard deviation of one point along its direction as measured in this image,
    `correlation` the number of neighbouring points that share one error. `ambiguity` px is how far
    the visible edge may lie from the bore's edge (burr, die roll, edge break), `drawn` (n,) px how
    far the bore's wall may have drawn each point, by a share common to all, `blur` px the width of
    the edge. `ellipse` is the robust fit (x, y, semi-major, semi-minor, angle rad) in pixels.
    """

    points: Array
    directions: Array
    sigma: float
    correlation: float
    ellipse: tuple[float, float, float, float, float]
    ambiguity: float = 0.0
    drawn: Array | float = 0.0
    blur: float = 1.0
    quality: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Stripe:
    """The stripe on the sheet on both sides of the hole.

    `points` (n, 2) px, the centre of the stripe row by row (or column by column); `side` (n,) is
    -1 or +1; `sigma` px is the standard deviation of one point across the stripe, `correlation`
    the number of neighbouring points that share one error, `bias` px the standard uncertainty of
    what all points share (speckle, asymmetric profile).
    """

    points: Array
    side: Array
    sigma: float
    correlation: float
    bias: float = 0.02
    quality: dict[str, float] = field(default_factory=dict)
