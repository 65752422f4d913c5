"""What corrections are worth on the virtual cell: CMM offsets learnt on the master, and kinematics.

Both are measured on bodies that nothing was learnt from, against what the simulator knows of them.
"""

from pathlib import Path

import numpy as np
import pytest
from made_workplace import workplace

from cell.core.documents.calibration import KinematicsDocument
from cell.core.documents.text import dump
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question
from cell.programs.inspection import BodyInspection, prepare
from cell.programs.offsets import study_offsets, write_offsets
from cell.programs.run import begin, measure
from cell.programs.station import open_station
from cell.recording import Recorder
from cell.sim.bodies import Delivery
from cell.sim.scene import read_scene
from cell.sim.world import draw_world

__all__ = ["workplace"]
pytestmark = [pytest.mark.bench, pytest.mark.timeout(1800)]

SPEED = 20.0
RUNS = 4
BODIES = (31, 57)


def run_body(log: Path, body: str, deliver):
    """Measure one body as `cell run` does; return its features and the truth by hole."""
    prepared = prepare(Path("jobs/demo.yaml"))
    with open_station(prepared.papers.station, prepared.folder, SPEED) as station:
        deliver(station.world)
        start = begin(prepared, station, body, log.stem)
        inspection = BodyInspection(station, prepared, start, Recorder(log, start),
                                    lambda *_: None)
        assert measure(inspection) == "complete"
        truth = {hole["id"]: [*hole["centre_mm"], hole["diameter_mm"]]
                 for hole in station.world.truth()["holes"]}
    return inspection.result.features, truth


def errors(features, truth):
    """Corrected and raw errors, and both standard uncertainties, of every axis with an offset."""
    rows = []
    for feature in features:
        if feature.measured is None:
            continue
        raw = dict(zip("xyzd", (*feature.outcome.centre, feature.outcome.diameter), strict=True))
        before = dict(zip("xyzd", np.sqrt(np.diag(feature.outcome.covariance)), strict=True))
        rows += [(axis, feature.measured[axis] - true, raw[axis] - true, feature.uncertainty[axis],
                  before[axis]) for axis, true in zip("xyzd", truth[feature.id], strict=True)
                 if axis in feature.offset]
    return rows


def test_the_true_kinematics_bring_a_body_nearer_to_the_truth(workplace, capsys) -> None:
    """An arm as it may come. Sensor, hand-eye and registration are right, as if found with
    corrected poses; cold links, hysteresis and repeatability stay wrong.
    """
    scene = workplace.cell / "scene.yaml"
    for old, new in (("length_mm: 0.025\n  angle_deg: 0.004", "length_mm: 0.1\n  angle_deg: 0.02"),
                     ("sensor_errors: {focal: 0.0002, principal_px: 0.5, k1: 0.01, k2: 0.2, "
                      "tangential: 0.0002, plane_mm: 0.02, plane_deg: 0.015}", "sensor_errors: {}"),
                     ("hand_eye_errors: {mm: 0.05, deg: 0.01}", "hand_eye_errors: {}"),
                     ("fixture_errors: {mm: 0.05, deg: 0.005}", "fixture_errors: {}")):
        workplace.replace(scene, old, new)
    gaps = {}
    for name in ("reported", "corrected"):
        features, truth = run_body(workplace.folder / f"{name}.rrd", name,
                                   lambda world: world.deliver(Delivery(BODIES[0])))
        gaps[name] = np.array([np.subtract(feature.outcome.centre, truth[feature.id][:3])
                               for feature in features if feature.measured is not None])
        write_true_kinematics(workplace)
    audit = audit_log(workplace.folder / "corrected.rrd", Question(unsealed=True))
    assert audit.answer == "identical", audit.differences[:3]
    with capsys.disabled():
        for name, gap in gaps.items():
            print(f"\n  {name}: mean |error| {np.abs(gap).mean(axis=0).round(4)} mm, rms "
                  f"{np.sqrt(np.mean(gap**2)):.4f}; n {len(gap)}", end="")
    rms = {name: np.sqrt(np.mean(gap**2)) for name, gap in gaps.items()}
    assert rms["corrected"] < 0.5 * rms["reported"]


def write_true_kinematics(workplace):
    """Put into the set what a perfect kinematic calibration would find."""
    arm = draw_world(read_scene(workplace.cell / "scene.yaml")).arm
    gaps = {name: tuple(map(float, np.subtract(getattr(arm.warm, name), getattr(arm.model, name))))
            for name in ("a", "d", "alpha", "theta")}
    (workplace.active_set / "kinematics.yaml").write_text(
        dump(KinematicsDocument(model=arm.scene.model, **gaps)))


def test_offsets_bring_other_bodies_nearer_to_the_truth(workplace, capsys) -> None:
    logs = workplace.folder / "logs"
    logs.mkdir()
    masters = [logs / f"master_{index}.rrd" for index in range(RUNS)]
    for log in masters:
        run_body(log, "MASTER", lambda world: world.deliver_master())
    learnt = study_offsets(masters, days=30)
    write_offsets(learnt.study, learnt.place)
    rows = []
    for seed in BODIES:
        log = logs / f"body_{seed}.rrd"
        rows += errors(*run_body(log, f"B{seed}",
                                 lambda world, seed=seed: world.deliver(Delivery(seed))))
        audit = audit_log(log, Question(unsealed=True))
        assert audit.answer == "identical", audit.differences[:3]
    with capsys.disabled():
        show(learnt, rows)
    for axis in "xyz":
        corrected, raw, *_ = of_axis(rows, axis)
        assert np.mean(np.abs(corrected)) < 0.6 * np.mean(np.abs(raw))
    corrected, _, after, before = of_axis(rows, "xyz")
    assert np.sqrt(np.mean(np.square(corrected / after))) < 1.5
    assert np.mean(after) < 0.6 * np.mean(before)


def of_axis(rows, axes):
    return np.array([row[1:] for row in rows if row[0] in axes]).T


def show(learnt, rows):
    s = {each.offset.repeatability for each in learnt.study.learnt if each.offset.axis != "d"}
    print(f"\n{len(learnt.study.learnt)} offsets from {RUNS} runs, pooled s of a centre's axis "
          f"{min(s):.4f} mm; bodies {BODIES}")
    for axis in ("x", "y", "z", "xyz", "d"):
        corrected, raw, after, before = of_axis(rows, axis)
        print(f"  {axis:>3}: mean |error| {np.mean(np.abs(raw)):.4f} -> "
              f"{np.mean(np.abs(corrected)):.4f} mm; u {np.mean(before):.4f} -> "
              f"{np.mean(after):.4f}; rms error/u {np.sqrt(np.mean((raw / before)**2)):.2f} -> "
              f"{np.sqrt(np.mean((corrected / after)**2)):.2f}; n {len(raw)}")
