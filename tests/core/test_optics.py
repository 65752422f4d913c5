"""The camera model against OpenCV's projection, and there and back to the corners of the image."""

import cv2
import numpy as np
import pytest

from cell.core.geometry import Plane
from cell.core.optics import CameraModel, SensorModel

PRINTED = CameraModel((768, 576), np.array([[3484.78278, 0.0, 310.046518],
                                            [0.0, 3472.023859, 312.197608], [0.0, 0.0, 1.0]]),
                      np.array([0.299731, 3.218002, 0.013074, -0.023963, 0.0]))
WIDE = CameraModel((1920, 1080), np.array([[1144.4, 0.0, 953.0], [0.0, 1142.5, 561.0],
                                           [0.0, 0.0, 1.0]]),
                   np.array([-0.21, 0.09, 0.0011, -0.0007, -0.02]))
CROPPED = CameraModel((240, 200), np.array([[1144.4, 0.0, -480.0], [0.0, 1142.5, 34.0],
                                            [0.0, 0.0, 1.0]]), WIDE.distortion)


@pytest.mark.parametrize("camera", [PRINTED, WIDE, CROPPED], ids=["printed", "wide", "cropped"])
def test_a_pixel_comes_back_from_its_ray(camera: CameraModel) -> None:
    width, height = camera.image_size
    u, v = np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 7))
    pixels = np.stack([u, v], axis=-1)
    points_in_camera = camera.rays(pixels) * np.linspace(180.0, 320.0, 9)[None, :, None]
    assert camera.project(points_in_camera) == pytest.approx(pixels, abs=1e-9)


@pytest.mark.parametrize("camera", [PRINTED, WIDE], ids=["printed", "wide"])
def test_projection_is_that_of_opencv(camera: CameraModel) -> None:
    points = np.random.default_rng(3).uniform([-25, -20, 220], [25, 20, 280], (200, 3))
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix,
                                  camera.distortion)
    assert camera.project(points) == pytest.approx(theirs[:, 0], abs=1e-9)


def test_the_printed_plane_has_its_own_distance_and_angle_not_those_of_the_text() -> None:
    plane = Plane.from_coefficients([1.0, -0.000395, 0.555042, -134.560160])
    sensor = SensorModel(PRINTED, plane)
    assert sensor.working_distance == pytest.approx(242.4324, abs=1e-4)
    assert np.degrees(sensor.triangulation_angle) == pytest.approx(29.0321, abs=1e-4)
