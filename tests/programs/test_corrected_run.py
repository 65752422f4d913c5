"""A set with kinematics: the run measures with them, and the audit comes to the same bits."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_body import measured_anew, record_body

from cell.core.documents.calibration import KinematicsDocument
from cell.core.documents.papers import Papers
from cell.core.documents.text import dump
from cell.core.errors import DocumentError
from cell.metrology.measure.hole import measure_hole
from cell.programs.audit.log import audit_log
from cell.programs.audit.question import Question

KINEMATICS = KinematicsDocument(
    model="ur10e", a=(0.0, 0.1, -0.1, 0.0, 0.0, 0.0), d=(0.05, 0.0, 0.0, 0.1, 0.0, 0.0),
    alpha=(0.0,) * 6, theta=(0.0, 1e-4, 0.0, -1e-4, 0.0, 0.0), remaining_mm=0.03,
    remaining_deg=0.002)


def with_kinematics(start, document=KINEMATICS):
    return replace(start, recording_id="corrected",
                   papers=start.papers | {"kinematics": dump(document)})


def measured_with(start, record):
    papers = Papers.parse(start.papers, start.set_id)
    attempts = tuple(replace(attempt, outcome=measure_hole(
        record.observation.first(attempt.views), papers.hole(record.observation.hole_id),
        papers.calibration, papers.job.method, np.radians(papers.job.normal_sigma_deg)))
        for attempt in record.attempts)
    return replace(record, attempts=attempts)


def test_the_audit_reproduces_a_run_with_kinematics(tmp_path):
    plain, holes = measured_anew()
    start = with_kinematics(plain)
    record = measured_with(start, holes[0])
    moved = record.outcome.centre - holes[0].outcome.centre
    assert 0.05 < np.linalg.norm(moved) < 0.5
    assert record.outcome.diameter == pytest.approx(holes[0].outcome.diameter, abs=1e-3)
    audit = audit_log(record_body(tmp_path / "corrected.rrd", start, (record,)),
                      Question(unsealed=True))
    assert (audit.answer, audit.differences) == ("identical", ())


def test_the_audit_finds_results_of_a_run_without_them(tmp_path):
    plain, holes = measured_anew()
    audit = audit_log(record_body(tmp_path / "other.rrd", with_kinematics(plain), holes[:1]),
                      Question(unsealed=True))
    assert any("centre" in difference.where for difference in audit.differences)


def test_kinematics_of_another_arm_are_refused():
    plain, _ = measured_anew()
    start = with_kinematics(plain, KINEMATICS.model_copy(update={"model": "ur5e"}))
    with pytest.raises(DocumentError, match="estimated for a ur5e"):
        Papers.parse(start.papers, start.set_id)
