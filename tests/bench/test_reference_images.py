"""Independently rendered pairs with exact truth: accuracy, honesty and refusals, pair by pair.

Asked with nominals: 3D error at most 0.03 mm for easy, 0.05 for medium, 0.08 for hard pairs, plus
half the ambiguity of the edge, median at most 0.015; within 3 u with and without nominals; the
invalid ones refused with the right reason.
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
from cell.core.errors import DocumentError, UnmeasurableError
from cell.metrology.features import Expected
from cell.metrology.locate.pair import locate_pair

pytestmark = [pytest.mark.bench, pytest.mark.timeout(600)]
LIMITS = {"easy": 0.03, "medium": 0.05, "hard": 0.08}
UNREADABLE = ("truncated", "wrong_size", "cropped", "unreadable")


def read(folder):
    truth = json.loads((folder / "truth.json").read_text())
    path = folder.parent / "sensors" / f"{truth['sensor']}.yaml"
    document = parse(SensorDocument, read_text(path), str(path))
    return truth, document.model, [folder / name for name in ("hole.png", "stripe.png")]


def plan_of(truth):
    plan = truth["nominal"]
    return Expected(normal=np.array(plan["normal"]), radius=plan["radius_mm"],
                    thickness=plan["thickness_mm"])


def locate(truth, sensor, paths, expected):
    """The error (4,) and u (4,), or the reason."""
    try:
        images = [read_image(path, sensor.camera.image_size) for path in paths]
        found = locate_pair(images[0], images[1], sensor, expected)
    except (UnmeasurableError, DocumentError) as refused:
        return getattr(refused, "reason", "bad_input")
    error = np.append(found.centre, found.radius) - [*truth["centre_mm"], truth["radius_mm"]]
    return error, np.sqrt(np.diag(found.covariance))


@pytest.fixture
def folders():
    return sorted(folder for folder in shared_data("reference-images").iterdir()
                  if (folder / "truth.json").exists())


def cells(outcome):
    if isinstance(outcome, str):
        return outcome, ""
    error, u = outcome
    return f"{1e3 * np.linalg.norm(error[:3]):.1f}", f"{np.abs(error / u).max():.1f}"


def test_reference_images(folders, capsys):
    table = Table("pair", "", "with plan, um", "|e|/u", "asked, um", "without, um", "|e|/u")
    faults, errors = [], []
    for folder in folders:
        truth, sensor, paths = read(folder)
        outcomes = [locate(truth, sensor, paths, plan_of(truth)),
                    locate(truth, sensor, paths, Expected())]
        kind = truth["difficulty"] if truth["valid"] else truth["reason"]
        limit = LIMITS.get(kind, 0.0) + truth["edge_ambiguity_mm"] / 2.0
        table.add_row(folder.name, kind, *cells(outcomes[0]), f"{1e3 * limit:.0f}",
                      *cells(outcomes[1]))
        faults += [f"{folder.name}: {fault}" for fault in judge(truth, outcomes, limit)]
        if truth["valid"] and not isinstance(outcomes[0], str):
            errors.append(np.linalg.norm(outcomes[0][0][:3]))
    with capsys.disabled():
        Console(width=110).print(table)
        print(f"median with plan {1e3 * np.median(errors):.1f} um (asked 15)", *faults, sep="\n")
    assert np.median(errors) < 0.015
    assert not faults


def judge(truth, outcomes, limit):
    """Say what is wrong with the outcomes with and without the plan."""
    for name, outcome in zip(("with plan", "without"), outcomes, strict=True):
        if not truth["valid"]:
            if outcome != truth["reason"] and truth["reason"] not in UNREADABLE:
                yield f"{name}: expected {truth['reason']}, came {outcome}"
        elif isinstance(outcome, str):
            yield f"{name}: refused, {outcome}"
        elif (np.abs(outcome[0]) > 3.0 * outcome[1]).any():
            yield f"{name}: off by {np.abs(outcome[0] / outcome[1]).max():.1f} u"
        elif name == "with plan" and np.linalg.norm(outcome[0][:3]) > limit:
            yield f"{name}: off by {1e3 * np.linalg.norm(outcome[0][:3]):.0f} um"
