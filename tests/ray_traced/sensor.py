"""The sensors that the pairs are seen by, written as `sensor.yaml` has them, and mirrored.

Own arithmetic on purpose: the pairs judge the lens model of `cell`, so they do not borrow it.
"""

from dataclasses import dataclass, replace

import numpy as np
import yaml

STEPS = 25  # of the fixed point: each gains two digits with these lenses


@dataclass(frozen=True)
class Sensor:
    """Camera (px; pixel centres at integers) and light plane a, b, c, d (camera frame, mm)."""

    name: str
    focal: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float, float]  # k1, k2, p1, p2, k3, as OpenCV has them
    light_plane: tuple[float, float, float, float]
    size: tuple[int, int] = (768, 576)

    @property
    def laser_normal(self):
        """Unit normal (3,) and offset of the light plane: normal @ p + offset = 0, mm."""
        plane = np.array(self.light_plane)
        plane = plane / np.linalg.norm(plane[:3])
        return plane[:3], plane[3]

    def project(self, points):
        """Project points (..., 3) of the camera frame to pixels (..., 2)."""
        x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
        bend, shift_x, shift_y = self._distortion(x, y)
        return np.stack([self.focal[0] * (x * bend + shift_x) + self.centre[0],
                         self.focal[1] * (y * bend + shift_y) + self.centre[1]], axis=-1)

    def slopes(self, pixels):
        """Find x/z and y/z (..., 2) of the rays that end in pixels (..., 2)."""
        x_seen = (pixels[..., 0] - self.centre[0]) / self.focal[0]
        y_seen = (pixels[..., 1] - self.centre[1]) / self.focal[1]
        x, y = x_seen, y_seen
        for _ in range(STEPS if any(self.distortion) else 0):
            bend, shift_x, shift_y = self._distortion(x, y)
            x, y, last = (x_seen - shift_x) / bend, (y_seen - shift_y) / bend, x
            if np.abs(x - last).max(initial=0.0) < 1e-14:
                break
        return np.stack([x, y], axis=-1)

    def _distortion(self, x, y):
        k1, k2, p1, p2, k3 = self.distortion
        rr = x * x + y * y
        return (1.0 + rr * (k1 + rr * (k2 + rr * k3)),
                2.0 * p1 * x * y + p2 * (rr + 2.0 * x * x),
                p1 * (rr + 2.0 * y * y) + 2.0 * p2 * x * y)

    def mirrored(self, left_right, top_bottom):
        """Give the sensor whose pictures are this one's, flipped."""
        (a, b, c, d), (k1, k2, p1, p2, k3) = self.light_plane, self.distortion
        (cx, cy), (width, height) = self.centre, self.size
        if left_right:
            cx, a, p2 = width - 1 - cx, -a, -p2
        if top_bottom:
            cy, b, p1 = height - 1 - cy, -b, -p1
        ending = "_flipped_" + "x" * left_right + "y" * top_bottom
        return replace(self, name=self.name + ending * (left_right or top_bottom),
                       centre=(cx, cy), distortion=(k1, k2, p1, p2, k3), light_plane=(a, b, c, d))

    def as_yaml(self):
        """Write what stands in `sensor.yaml`."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return yaml.safe_dump({
            "image_size": list(self.size), "camera_matrix": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
            "distortion": list(self.distortion), "light_plane": list(self.light_plane)},
            default_flow_style=None, sort_keys=False)


def _plane_of(distance, angle_deg):
    """Give the light plane that meets the optic axis at a distance, under an angle."""
    angle = np.radians(angle_deg)
    return (float(np.cos(angle)), 0.0, float(np.sin(angle)), float(-distance * np.sin(angle)))


PAPER = Sensor("A", (3484.78278, 3472.023859), (310.046518, 312.197608),
               (0.299731, 3.218002, 0.013074, -0.023963, 0.0),
               (0.874347780959387, -0.0003453673734789579, 0.4852997410392601, -117.65237730154007))
STEEP = replace(PAPER, name="B", light_plane=_plane_of(253.0417, 20.7712))
PINHOLE = (0.0, 0.0, 0.0, 0.0, 0.0)
SENSORS = (PAPER, STEEP, replace(PAPER, name="A_nodist", distortion=PINHOLE),
           replace(STEEP, name="B_nodist", distortion=PINHOLE))
