"""Real rims: washers under a ring light and before a back light, against a measuring machine."""

import csv

import cv2
import numpy as np
import pytest

from cell.core.optics import CameraModel
from cell.metrology.detect.hole import detect_hole
from cell.metrology.features import Expected

pytestmark = pytest.mark.bench

ROBUST_SPREAD = {"ccd3": 4.6, "ccd4": 1.5}  # micrometres, of a plain robust fit; 20 % more is asked


@pytest.mark.timeout(600)
@pytest.mark.parametrize("camera", ROBUST_SPREAD)
def test_every_inner_rim_is_found(camera, test_data, capsys):
    folder = test_data / "washers"
    with (folder / "cmm.csv").open() as table:
        truth = {int(row["part"]): float(row["inner_diameter_mm"]) for row in csv.DictReader(table)}
    found, true = [], []
    for path in sorted((folder / camera).glob("*.png")):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        height, width = image.shape
        matrix = np.array([[3000.0, 0, width / 2], [0, 3000.0, height / 2], [0, 0, 1.0]])
        rim = detect_hole(image, CameraModel((width, height), matrix, np.zeros(5)), Expected())
        found.append(sum(rim.ellipse[2:4]))
        true.append(truth[int(path.stem)])
    found, true = np.array(found), np.array(true)
    left = 1e3 * (true - np.median(true / found) * found)
    spread = 1.4826 * np.median(np.abs(left - np.median(left)))
    with capsys.disabled():
        print(f"\n{camera}: robust spread {spread:.1f} um, largest {np.abs(left).max():.1f} um")
    assert len(found) == 8
    assert spread < 1.2 * ROBUST_SPREAD[camera]
