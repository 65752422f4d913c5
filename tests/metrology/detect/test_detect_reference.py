"""The detector on pictures that others made: the reference pairs, and real dots under a laser."""

import json

import cv2
import numpy as np
import pytest

from cell.core.documents.calibration import SensorDocument
from cell.core.documents.text import parse
from cell.core.errors import UnmeasurableError
from cell.metrology.detect.pair import detect_pair
from cell.metrology.features import Expected

FREE = 0.1  # px of centre error where the edge is not ambiguous


def read(folder, sensor_file):
    images = [cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
              for name in ("hole.png", "stripe.png")]
    sensor = parse(SensorDocument, sensor_file.read_text(), str(sensor_file)).model
    return images, sensor, json.loads((folder / "truth.json").read_text())


def nominals(truth):
    plan = truth["nominal"]
    return Expected(normal=np.array(plan["normal"]), radius=plan["radius_mm"],
                    thickness=plan["thickness_mm"])


def true_centre(camera, truth):
    """The centre of the projected rim: of the ellipse, not of the circle."""
    normal = np.array(truth["normal"])
    u = np.cross(normal, [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    t = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)[:, None]
    circle = np.array(truth["centre_mm"]) + truth["radius_mm"] * (
        np.cos(t) * u + np.sin(t) * np.cross(normal, u))
    x, y = camera.project(circle).T
    offset = np.array([x.mean(), y.mean()])
    x, y = x - offset[0], y - offset[1]
    a, b, c, d, e = np.linalg.lstsq(np.stack([x*x, x*y, y*y, x, y], axis=1), np.ones(400),
                                    rcond=None)[0]
    return offset + np.linalg.solve([[2*a, b], [b, 2*c]], [-d, -e])


@pytest.mark.parametrize("known", [True, False], ids=["nominals", "nothing known"])
@pytest.mark.parametrize("pair", range(19))
def test_reference_pair(pair, known, test_data):
    folder = test_data / "reference-images" / f"{pair:03d}"
    truth = json.loads((folder / "truth.json").read_text())
    (hole, stripe), sensor, _ = read(folder, folder.parent / "sensors" / f"{truth['sensor']}.yaml")
    expected = nominals(truth) if known else Expected()
    if not truth["valid"]:
        with pytest.raises(UnmeasurableError) as refused:
            detect_pair(hole, stripe, sensor, expected)
        assert refused.value.reason == truth["reason"]
        return
    rim, line = detect_pair(hole, stripe, sensor, expected)
    scale = sensor.camera.matrix[0, 0] / truth["centre_mm"][2]
    allowed = (FREE if known else 3 * FREE) + 0.6 * truth["edge_ambiguity_mm"] * scale
    assert np.hypot(*(np.array(rim.ellipse[:2]) - true_centre(sensor.camera, truth))) < allowed
    on_sheet = sensor.light_plane.meet(sensor.camera.rays(line.points))
    off = (on_sheet - truth["centre_mm"]) @ truth["normal"]
    assert abs(off.mean()) < 0.015  # mm


@pytest.mark.parametrize("crossing", range(16))
def test_every_crossing_of_dot_and_laser_is_found(crossing, test_data):
    folder = test_data / "laser-dots" / f"{crossing:03d}"
    (hole, stripe), sensor, truth = read(folder, folder / "sensor.yaml")
    rim, line = detect_pair(hole, stripe, sensor, Expected())
    assert np.hypot(*(np.array(rim.ellipse[:2]) - true_centre(sensor.camera, truth))) < 0.25
    assert min((line.side < 0).sum(), (line.side > 0).sum()) > 15
