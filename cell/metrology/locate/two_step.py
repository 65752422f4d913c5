"""The two-step method of the paper, as printed: the reference that the joint estimate is judged by.

| symbol | meaning | unit | equation |
|---|---|---|---|
| A, B | ends of the chord that the light plane cuts from the hole | mm | 3.1 (3) |
| Q | midpoint of A B | mm | (5) |
| x_m, y_m, z_m | measured centre of the circle, camera frame | mm | (6), (11), (12) |
| r_1, r_2, r | distances of the centre from A and B, and their mean | mm | (13), (14) |

Written differently, with the same meaning: the ray X = t (x_n, y_n, 1) for (2), which is 0/0 on the
axis; a general conic for (3), which is an ellipse along the axes; n·u + c = 0 for (4), which is
singular when the stripe is vertical. No absolute values in (7) to (10): x_m, y_m and z_m lie on the
ray to the ellipse's centre, whatever its quadrant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cell.core.documents.result import Located
from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import SensorModel
from cell.metrology.features import Expected, Rim, Stripe
from cell.metrology.locate.conic import chord, ellipse_centre, fit_line
from cell.metrology.locate.joint import normal_sigma, solve_seen
from cell.metrology.locate.joint_rows import Sight, StripeSight
from cell.metrology.locate.trace import trace_circle
from cell.metrology.locate.uncertainty import shares, total, two_step_budget
from cell.metrology.reasons import refusal

HELD = 1e-6  # rad: a normal that is not estimated
UNMOVED = Transform.identity()


@dataclass(frozen=True, eq=False)
class TwoStep:
    """The result of the equations: centre (3,) and radius in mm, A, B and Q (3,) on the way."""

    centre: Array
    radius: float
    A: Array
    B: Array

    @property
    def Q(self) -> Array:  # noqa: N802  the paper's symbol
        """The midpoint of the chord, equation (5)."""
        return (self.A + self.B) / 2.0


def solve_two_step(conic: Array, line: Array, light_plane: Plane) -> TwoStep:
    """Solve equations (5), (6) and (11) to (14).

    Args:
        conic: of the hole, (3, 3), in normalised coordinates.
        line: of the stripe, (n_x, n_y, c), in normalised coordinates.
        light_plane: in the camera frame, mm.

    Raises:
        UnmeasurableError: the stripe misses the hole, or lies behind the camera.
    """
    A, B = (light_plane.meet(np.append(end, 1.0)) for end in chord(conic, line))
    z_Q = (A[2] + B[2]) / 2.0
    if not (np.isfinite(z_Q) and z_Q > 0):
        raise refusal("no_laser", "what was found does not lie in front of the camera")
    centre = z_Q * np.append(ellipse_centre(conic), 1.0)
    r_1, r_2 = np.linalg.norm(centre - A), np.linalg.norm(centre - B)
    return TwoStep(centre, float(r_1 + r_2) / 2.0, A, B)


def locate_two_step(rim: Rim, stripe: Stripe, sensor: SensorModel, expected: Expected) -> Located:
    """Locate the hole in the camera frame by the paper's method, with its uncertainty.

    The expected normal is used for the uncertainty alone: the method does not correct the tilt.

    Raises:
        UnmeasurableError: not enough points, no ellipse, or the stripe misses the hole.
    """
    sight, crossing = Sight.of(rim, sensor.camera), StripeSight.of(stripe, sensor, UNMOVED)
    conic, line = sight.conic, fit_line(crossing.sight.rays[:, :2])
    solved = solve_two_step(conic, line, sensor.light_plane)
    held = replace(expected, normal_sigma=HELD)
    solution = solve_seen(rim, sight, (crossing,), held).solutions[0]
    budget = two_step_budget(np.append(solved.centre, solved.radius), solution,
                             normal_sigma(expected), rim, sensor)
    trace = {"chord": np.stack([solved.A, solved.B]), "q": solved.Q, "centre": solved.centre}
    return Located("two-step", solved.centre, solved.radius, None, total(budget), shares(budget),
                   {**rim.quality, **stripe.quality},
                   trace_circle(solution.circle, rim, stripe, sensor)
                   | {name: sensor.camera.project(points) for name, points in trace.items()},
                   budget)
