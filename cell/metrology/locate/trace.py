"""What to draw over the images of a located hole, in raw pixels: `Located.trace`.

| key | shape | meaning |
|---|---|---|
| `rim`, `stripe` | (n, 2) | the points that were used |
| `ellipse` | (73, 2) | the circle as the lens shows it, closed |
| `chord`, `q` | (2, 2), (2,) | A and B, and their midpoint; absent where light and hole miss |
| `centre` | (2,) | the circle's centre |

All belong to the image with the rim; for a stripe seen from elsewhere that is where it would show.
"""

from __future__ import annotations

import numpy as np

from cell.core.geometry import Array, Plane, cross
from cell.core.optics import SensorModel
from cell.metrology.features import Rim, Stripe
from cell.metrology.locate.error_model import chord_midpoint_error
from cell.metrology.locate.joint_rows import Circle

X_AXIS = np.array([1.0, 0.0, 0.0])
TURN = np.linspace(0.0, 2.0 * np.pi, 73)
ROUND = np.stack([np.cos(TURN), np.sin(TURN)], axis=-1)


def trace_circle(circle: Circle, rim: Rim, stripe: Stripe, sensor: SensorModel) -> dict[str, Array]:
    """Draw a circle of the camera frame, its centre, and the chord that the light plane cuts."""
    centre, normal, radius = circle.centre, circle.normal, circle.radius
    first = X_AXIS - normal[0] * normal  # what the camera sees never faces along its x
    first = first / np.linalg.norm(first)
    second = cross(normal, first)
    round_it = centre + radius * ROUND @ np.stack([first, second])
    points = {"centre": centre, **_chord(centre, normal, radius, sensor.light_plane)}
    return {"rim": rim.points, "stripe": stripe.points, "ellipse": sensor.camera.project(round_it),
            **{name: sensor.camera.project(point) for name, point in points.items()}}


def _chord(centre: Array, normal: Array, radius: float, plane: Plane) -> dict[str, Array]:
    middle = centre + chord_midpoint_error(plane, centre, normal)
    square = radius**2 - float(np.sum((middle - centre)**2))
    if square <= 0:
        return {}
    along = cross(normal, plane.normal)
    arm = np.sqrt(square) * along / np.linalg.norm(along)
    return {"chord": np.stack([middle - arm, middle + arm]), "q": middle}
