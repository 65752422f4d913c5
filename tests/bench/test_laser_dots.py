"""Real photographs of a laser line across printed dots.

Asked: every crossing answered, the rms of z at least three times smaller than the plain method's
when the normal is given, errors within three combined standard uncertainties.
"""

import json

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table
from shared_data import shared_data

from cell.archive.files import read_text
from cell.archive.images import read_image
from cell.core.documents.calibration import SensorDocument
from cell.core.documents.text import parse
from cell.metrology.features import Expected
from cell.metrology.locate.pair import locate_pair

pytestmark = [pytest.mark.bench, pytest.mark.timeout(600)]
TRUTH_U = np.array([0.07, 0.02, 0.15, 0.02])


def crossings():
    for folder in sorted(shared_data("laser-dots").glob("0*")):
        document = parse(SensorDocument, read_text(folder / "sensor.yaml"), str(folder))
        images = [read_image(folder / name, document.image_size)
                  for name in ("hole.png", "stripe.png")]
        yield json.loads((folder / "truth.json").read_text()), document.model, images


def test_laser_dots(capsys):
    errors, ratios = {}, {}
    for truth, sensor, images in crossings():
        plan = Expected(normal=np.array(truth["normal"]), radius=truth["radius_mm"])
        for name, expected, method in (("plain two-step", plan, "two-step"),
                                       ("joint, normal given", plan, "joint"),
                                       ("joint, nothing given", Expected(), "joint")):
            found = locate_pair(images[0], images[1], sensor, expected, method)
            error = np.append(found.centre, found.radius) - [*truth["centre_mm"],
                                                             truth["radius_mm"]]
            combined = np.hypot(np.sqrt(np.diag(found.covariance)), TRUTH_U)
            errors.setdefault(name, []).append(error)
            ratios.setdefault(name, []).append(np.abs(error) / combined)
    rms = {name: np.sqrt(np.mean(np.square(error), axis=0)) for name, error in errors.items()}
    worst = {name: np.max(ratio) for name, ratio in ratios.items()}
    table = Table("rms, mm", "x", "y", "z", "radius", "worst |e|/u")
    for name, row in rms.items():
        table.add_row(name, *(f"{value:.3f}" for value in row), f"{worst[name]:.2f}")
    with capsys.disabled():
        Console(width=110).print(table)
    assert len(errors["joint, normal given"]) == 16
    assert rms["plain two-step"][2] > 3.0 * rms["joint, normal given"][2]
    assert max(worst.values()) < 3.0
