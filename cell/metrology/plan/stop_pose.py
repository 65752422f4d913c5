"""Where the camera stands before a hole: on its axis, upright, and with the hole in sight."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.documents.calibration import Calibration
from cell.core.documents.job import Stop
from cell.core.documents.nominals import Hole
from cell.core.geometry import Array, Transform
from cell.core.optics import SensorModel

STEEPEST_DEG = 60.0  # between the optic axis and the normal of a hole that is to be seen


def compute_pose(stop: Stop, hole: Hole, calibration: Calibration,
                 stand_off: float | None = None) -> Transform:
    """Compute base_from_flange from the nominal: the camera looks along the seen face's normal.

    `roll_deg` and `tilt_deg` of the stop turn it about the hole; `stand_off` mm as in `choose_aim`.
    """
    lean = Rotation.from_euler("ZX", [stop.roll_deg, stop.tilt_deg], degrees=True).as_matrix()
    turn = _upright(hole.normal_to_camera) @ lean
    aim = choose_aim(calibration.sensor.model, stand_off)
    body_from_camera = Transform.from_parts(turn, hole.centre_on_seen_face - turn @ aim)
    return calibration.base_from_body @ body_from_camera @ calibration.flange_from_camera.inverse


def step_back(base_from_flange: Transform, calibration: Calibration, distance: float) -> Transform:
    """Move a flange pose back along the camera's optic axis by `distance` mm."""
    hand_eye = calibration.flange_from_camera
    back = Transform.from_parts(np.eye(3), [0.0, 0.0, -distance])
    return base_from_flange @ hand_eye @ back @ hand_eye.inverse


def find_sight_problem(hole: Hole, base_from_flange: Transform,
                       calibration: Calibration) -> str | None:
    """Say why the hole, or the stripe across it, would not be seen from a pose; else None."""
    camera_from_body = calibration.body_from_camera(base_from_flange).inverse
    sensor = calibration.sensor.model
    centre = camera_from_body @ hole.centre_on_seen_face
    normal = camera_from_body.turn(hole.normal_to_camera)
    angle = float(np.degrees(np.arccos(np.clip(-normal[2], -1.0, 1.0))))
    if angle > STEEPEST_DEG:
        return (f"the camera would look at the face at {angle:.0f} degrees from its normal; "
                f"expected at most {STEEPEST_DEG:g}")
    return (_image_problem(sensor, centre, normal, hole.radius)
            or _stripe_problem(sensor, centre, normal, hole.radius))


def choose_aim(sensor: SensorModel, stand_off: float | None = None) -> Array:
    """Choose where in the camera frame (3,) mm a hole shall lie: on the light plane, on the optic
    axis, or behind the middle of the image where the optic axis leaves its inner half.

    `stand_off` mm along the optic axis replaces the distance of the light plane.
    """
    size = np.array(sensor.camera.image_size, dtype=np.float64)
    principal = sensor.camera.matrix[:2, 2]
    inner = bool((np.abs(principal - (size - 1.0) / 2.0) <= size / 4.0).all())
    ray = sensor.camera.rays(principal if inner else (size - 1.0) / 2.0)
    return ray * stand_off if stand_off is not None else sensor.light_plane.meet(ray)


def _image_problem(sensor: SensorModel, centre: Array, normal: Array, radius: float) -> str | None:
    rim = centre + radius * _circle(normal)
    if not (rim[:, 2] > 0.0).all():
        return "the hole would lie behind the camera"
    pixels, size = sensor.camera.project(rim), np.array(sensor.camera.image_size)
    if ((pixels >= 0.0) & (pixels <= size - 1)).all():
        return None
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return (f"the hole would not lie in the image: x {low[0]:.0f} to {high[0]:.0f}, "
            f"y {low[1]:.0f} to {high[1]:.0f} of {size[0]} x {size[1]} px")


def _stripe_problem(sensor: SensorModel, centre: Array, normal: Array, radius: float) -> str | None:
    """The light plane cuts the circle if it passes near enough, measured in the hole's plane."""
    slant = float(np.sqrt(1.0 - min(1.0, float(sensor.light_plane.normal @ normal) ** 2)))
    miss = abs(float(sensor.light_plane.distance(centre)))
    if miss < radius * slant:
        return None
    return (f"the stripe would miss the hole: the light plane passes {miss:.1f} mm from the centre "
            f"of a hole of radius {radius:g}")


def _circle(normal: Array, count: int = 24) -> Array:
    """Unit circle (count, 3) about a normal."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    across = _upright(normal)[:, :2]
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) @ across.T


def _upright(normal_to_camera: Array) -> Array:
    """Rotation body_from_camera that looks along -normal with the image's y down the body's -z."""
    z = -normal_to_camera
    down = np.array([0.0, 0.0, -1.0])
    if abs(float(z @ down)) > np.cos(np.radians(5.0)):
        down = np.array([1.0, 0.0, 0.0])  # a hole that faces up or down: rearwards is down
    y = down - z * (z @ down)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z], axis=1)
