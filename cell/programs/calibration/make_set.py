"""Making a set of a solved session: documents, raw views, pictures and report in one folder."""

from __future__ import annotations

import shutil
from dataclasses import dataclass

import numpy as np

from cell.archive.files import replace_text
from cell.archive.sets import write_set
from cell.core.documents.base import as_rows
from cell.core.documents.calibration import HandEyeDocument, SensorDocument
from cell.core.documents.calibration_session import SessionHeader
from cell.core.documents.text import dump
from cell.core.errors import DocumentError
from cell.core.geometry import Array
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.session import Session
from cell.programs.calibration.solve import Solution, before_and_after, chain_of
from cell.report.calibration import CalibrationPage, calibration_report


@dataclass(frozen=True)
class Signature:
    """Who made the set, when (UTC, as 2026-11-22T0955Z), and why warnings were accepted."""

    by: str
    at: str
    reason: str = ""


def make_set(session: Session, solution: Solution, belief: Belief, signature: Signature) -> str:
    """Write an immutable set from a session and return its id; the session stays as it is.

    Raises:
        DocumentError: the disk refuses.
    """
    made = belief.folder / f".making-{session.folder.name}"
    shutil.rmtree(made, ignore_errors=True)
    try:
        shutil.copytree(session.folder, made)
    except OSError as error:  # of many files, each with its own reason
        raise DocumentError(f"the session cannot be copied: {error}", source=str(made)) from None
    replace_text(made / "sensor.yaml", dump(sensor_document(solution, belief)))
    replace_text(made / "hand_eye.yaml", dump(hand_eye_document(session, solution, belief)))
    if (kinematics := chain_of(solution, belief).kinematics) is not None:
        replace_text(made / "kinematics.yaml", dump(kinematics))
    replace_text(made / "report.html", calibration_report(page_of(solution, session.header,
                                                                  belief, signature)))
    return write_set(belief.folder, made, signature.at)


def page_of(solution: Solution, header: SessionHeader, belief: Belief,
            signature: Signature) -> CalibrationPage:
    """Gather what the report shows."""
    facts = {"cell": header.cell, "what": header.what, "begun": header.begun,
             "operator": signature.by, "accepted because": signature.reason or "-",
             "robot": f"{header.robot.model} {header.robot.serial}",
             "kinematics": header.robot.kinematics_checksum or "-",
             "sensor": header.sensor_serial or "-",
             "board": f"{header.board.id}, {header.board.certificate or 'no certificate'}",
             "preconditions": "; ".join(map(str, header.warnings)) or "all met",
             "made upon the set": header.base_set}
    return CalibrationPage(facts, solution.verdict, solution.reasons, solution.gates,
                           solution.camera_result, solution.light_plane, solution.hand_eye,
                           tuple(view.board.pixels for view in solution.views),
                           solution.camera.image_size, solution.sphere,
                           [view.record.number for view in solution.views],
                           before_and_after(solution, belief))


def sensor_document(solution: Solution, belief: Belief) -> SensorDocument:
    """Write camera and light plane as a document; what was not solved stays."""
    known = belief.sensor_document
    changes: dict[str, object] = {}
    if solution.camera_result is not None:
        camera = solution.camera
        changes |= {"camera_matrix": _rows(camera.matrix), "distortion": _row(camera.distortion),
                    "camera_covariance": _rows(solution.camera_result.covariance),
                    "blur": camera.blur}
    if solution.light_plane is not None:
        plane = solution.light_plane.plane
        changes |= {"light_plane": (*_row(plane.normal), plane.offset),
                    "light_plane_covariance": _rows(solution.light_plane.covariance)}
    return known.model_copy(update=changes)


def hand_eye_document(session: Session, solution: Solution, belief: Belief) -> HandEyeDocument:
    """Write the hand-eye transform as a document; where it was not solved, it stays."""
    answer = solution.hand_eye
    if answer is None or answer.held_out is None:
        return belief.hand_eye
    result, still = answer.held_out.result, answer.figures["object_rms_mm"]
    if solution.kinematics is not None and solution.kinematics.useful:
        still = solution.kinematics.apart_with
    return belief.hand_eye.model_copy(update={
        "flange_from_camera": as_rows(chain_of(solution, belief).flange_from_camera),
        "robot": session.header.robot,
        "sensor_serial": session.header.sensor_serial,
        "covariance": _rows(result.covariance[:6, :6]),
        "robot_repeatability_mm": max(float(still / np.sqrt(3.0)), 0.01)})


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(_row(row) for row in matrix)


def _row(values: Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
