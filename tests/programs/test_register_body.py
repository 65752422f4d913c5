"""Registering the body: on the virtual cell against its truth, and over many noises in numbers."""

import re

import numpy as np
import pytest
from made_operator import Scripted
from made_workplace import Workplace

from cell.archive.files import read_text
from cell.core.documents.calibration import BodyDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.metrology.judge.datum import Datum, solve_body_registration
from cell.programs.calibration.body import BodyRequest, body_figures, register_body
from cell.sim.scene import read_scene
from cell.sim.world import draw_world

pytestmark = pytest.mark.timeout(300)
HELD = """\
  - [0.030753919750, 0.999510638740, -0.005716595649, 1629.399]
  - [-0.999496298864, 0.030707656068, -0.008011767368, 1515.746]
  - [-0.007832303466, 0.005960109444, 0.999951564886, -253.822]
  - [0.0, 0.0, 0.0, 1.0]
"""  # a millimetre and a twentieth of a degree from where it is believed
RPS = {"QP1": "xyz", "AP1": "yz", "SI1": "y"}  # 3-2-1


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The demo with an ideal arm and sensor, and the fixture elsewhere than believed."""
    place = Workplace.in_folder(tmp_path_factory.mktemp("register"))
    scene = place.cell / "scene.yaml"
    text, errors = re.subn(r"\b((?:plane_)?(?:mm|deg)|focal|principal_px|k1|k2|tangential): "
                           r"[0-9.]+(?=[,}])", r"\1: 0.0", scene.read_text())
    text, arms = re.subn(r"^(  (?:length_mm|angle_deg|hysteresis_deg|repeatability_deg|sway_deg|"
                         "cold_mm):) .*$", r"\1 0.0", text, flags=re.MULTILINE)
    text, fixtures = re.subn(r"(?<=base_from_fixture:\n)(  - .*\n){4}", HELD, text)
    assert (errors, arms, fixtures) == (11, 6, 1)
    scene.write_text(text)
    return place


@pytest.fixture(scope="module")
def truth(place):
    return draw_world(read_scene(place.cell / "scene.yaml")).base_from_fixture


def register(place, monkeypatch, operator=None, **words):
    monkeypatch.chdir(place.folder)
    return register_body(BodyRequest(place.job, speed=50.0, **words), operator or Scripted())


def off(done, truth, holes):
    """How far (mm) the registration would have holes, from where they are."""
    return np.linalg.norm(done.registration.measured_from_body @ holes - truth @ holes, axis=1)


@pytest.fixture(scope="module")
def holes(place):
    return np.loadtxt(place.nominals, delimiter=",", skiprows=1, usecols=(1, 2, 3))


def test_a_best_fit_finds_where_the_body_is(place, truth, holes, monkeypatch):
    believed = place.cell / "body" / "demo.yaml"
    old = believed.read_text()
    operator = Scripted()
    done = register(place, monkeypatch, operator)
    assert done.verdict == "pass" and done.registration.redundancy == 30
    assert off(done, truth, holes).max() < 0.12  # the believed one is a millimetre off
    assert set(done.registration.left_out) == set(parse(
        BodyDocument, read_text(believed), str(believed)).datums)
    assert max(done.registration.left_out.values()) < 0.15
    assert old in [file.read_text() for file in (believed.parent / "history").iterdir()]
    assert operator.heard("12/12")


def test_three_two_one_is_what_the_drawing_means(place, truth, holes, monkeypatch):
    with place.job.open("a") as job:
        job.write("alignment: {method: rps, datums: {QP1: xyz, AP1: yz, SI1: y}}\n")
    done = register(place, monkeypatch, fit="rps", reason="3-2-1 is as the drawing has it")
    assert done.registration.redundancy == 0 and done.written is not None
    assert {name: "".join(axes)
            for name, axes in done.registration.residuals.items()} == RPS
    assert all(abs(gap) < 1e-6 for axes in done.registration.residuals.values()
               for gap in axes.values())
    assert next(gate.name for gate in done.gates if gate.verdict == "warn") == "redundancy"
    assert "left_out_mm" not in [gate.name for gate in done.gates]
    assert off(done, truth, holes).max() < 0.5


def test_a_person_may_say_no(place, monkeypatch):
    with pytest.raises(DocumentError, match="stopped by the operator"):
        register(place, monkeypatch, Scripted({"master body": False}))


@pytest.mark.parametrize(("axes", "redundancy"), [(RPS, 0), (None, 30)], ids=["3-2-1", "best fit"])
def test_the_predicted_uncertainty_is_what_many_registrations_scatter_by(
        place, axes, redundancy):
    """At every hole of the job, from the holes that a CMM knows, 0.1 mm of noise an axis."""
    every = place.papers().holes
    known = [hole for hole in every
             if (hole.id in axes if axes else hole.cmm and {*"xyz"} <= {*hole.cmm})]
    centres = np.array([hole.centre for hole in every])
    rng, truth, found = np.random.default_rng(8), Transform.from_parts([0.3, 0.2, 1.5],
                                                                       [1600.0, 1500.0, -250.0]), []
    for _ in range(200):
        datums = [Datum(hole.id, hole.centre,
                        truth @ (np.array(hole.centre) + rng.normal(0.0, 0.1, 3)),
                        axes[hole.id] if axes else "xyz") for hole in known]
        registration = solve_body_registration(datums, truth.inverse, leave_out=False)
        found.append(registration.body_from_measured @ (truth @ centres) - centres)
    assert registration.redundancy == redundancy
    scatter = np.sqrt(np.mean(np.square(found), axis=0))
    np.testing.assert_allclose(scatter / registration.predict_sigma(centres), 1.0, atol=0.2)
    worst = body_figures(registration, every)["hole_sigma_mm"]
    assert worst == pytest.approx(np.sqrt((scatter ** 2).sum(axis=1)).max(), rel=0.15)
