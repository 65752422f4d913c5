"""A cell in miniature: calibration, one hole of a plan, and rendered views of it from anywhere."""

from dataclasses import dataclass

import numpy as np
from made_pairs import EXPOSURES, SENSOR, Scene

from cell.core.documents.calibration import (
    BodyDocument,
    Calibration,
    HandEyeDocument,
    RobotRecord,
    SensorDocument,
)
from cell.core.documents.nominals import Hole
from cell.core.geometry import Transform
from cell.core.observation import Observation, View

FLANGE_FROM_CAMERA = Transform.from_parts([0.05, -0.03, 0.2], [-58.3, 22.6, 71.4])
BASE_FROM_BODY = Transform.from_parts([0.02, -0.01, 1.5], [1629.7, 1515.1, -256.0])
SPREAD = tuple(tuple(float(v) for v in row)
               for row in np.diag([1e-9, 1e-9, 1e-9, 1e-4, 1e-4, 1e-4]))


def rows(matrix):
    return tuple(tuple(float(value) for value in row) for row in matrix)


def made_calibration(covariances=True):
    """A calibration that is right, and says how well it is known."""
    plane = SENSOR.light_plane
    sensor = SensorDocument(
        image_size=SENSOR.camera.image_size, camera_matrix=rows(SENSOR.camera.matrix),
        distortion=tuple(float(k) for k in SENSOR.camera.distortion),
        light_plane=tuple(float(c) for c in (*plane.normal, plane.offset)))
    hand_eye = HandEyeDocument(
        flange_from_camera=rows(FLANGE_FROM_CAMERA.matrix),
        robot=RobotRecord(model="ur10e", serial="1"), covariance=SPREAD if covariances else None,
        robot_repeatability_mm=0.02 if covariances else 0.0)
    body = BodyDocument(base_from_body=rows(BASE_FROM_BODY.matrix))
    return Calibration("made", sensor, hand_eye, body)


@dataclass(frozen=True, eq=False)
class Sight:
    """A scene as a plan's hole; `off` (3,) mm is how far the hole lies from its nominal."""

    scene: Scene
    off: np.ndarray
    side: str = "camera"

    @property
    def centre_in_body(self):
        """The truth on the seen face."""
        return BASE_FROM_BODY.inverse @ (self.scene.base_from_camera @ self.scene.centre)

    @property
    def normal_in_body(self):
        """The truth, towards the camera."""
        return BASE_FROM_BODY.inverse.turn(self.scene.base_from_camera.turn(self.scene.normal))

    @property
    def hole(self):
        """The plan's hole, on the face that `side` says."""
        normal, thickness = self.normal_in_body, self.scene.sheet.thickness
        centre = self.centre_in_body - self.off
        if self.side == "back":
            centre, normal = centre - thickness * normal, -normal
        tolerance = dict.fromkeys("xyzd", 0.5)
        return Hole("H", centre, normal, 2.0 * self.scene.radius, thickness, self.side,
                    frozenset("xyzd"), tolerance)

    def view(self, light, rng, attempt=0, camera_shift=(0.0, 0.0, 0.0), exposure_factor=1.0):
        """Take a picture, with the camera moved in its own frame."""
        base_from_camera = self.scene.base_from_camera @ Transform.from_parts(
            np.zeros(3), camera_shift)
        flange = base_from_camera @ FLANGE_FROM_CAMERA.inverse
        image = self.scene.picture(light, rng, base_from_camera)
        image = np.clip(image * exposure_factor, 0, 255).astype(np.uint8)
        return View(image, light, EXPOSURES[light], 0.0, flange, flange, (0.0,) * 6, attempt)

    def attempt(self, rng, number=0, camera_shift=(0.0, 0.0, 0.0)):
        """Take both pictures."""
        return tuple(self.view(light, rng, number, camera_shift) for light in ("ring", "laser"))

    def observe(self, *attempts):
        """Everything seen, with nothing predicted."""
        return Observation("H", tuple(view for views in attempts for view in views),
                           Transform.identity())
