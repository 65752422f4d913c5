"""The check between calibrations: fixed boards and spheres, against where they were first seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cell.archive.files import check_writable
from cell.core.documents.calibration_session import CalibrationPlan
from cell.core.documents.papers import check_identity
from cell.core.documents.targets import BoardDocument, SphereDocument
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Array, Transform
from cell.core.ports import Operator
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.detect_board import detect_board
from cell.metrology.calibrate.gates import Checked, Level, worst
from cell.metrology.study.drift import Drift, judge_drift
from cell.programs.calibration.belief import Belief, design_of, read_belief
from cell.programs.calibration.capture import drive, shoot
from cell.programs.calibration.drift_log import CORRECTED, LOG, append_check, read_past
from cell.programs.calibration.poses import free_path, plan_poses, plan_sphere, plan_start
from cell.programs.calibration.recorded import read_gates
from cell.programs.calibration.registrations import apply_corrections, plan_corrections
from cell.programs.calibration.sphere import SphereCheck, SphereLook, check_sphere, see_sphere
from cell.programs.station import Station, open_station

SPHERE_VIEWS = 8
VIEWS = CalibrationPlan(views=6, hold_out=0, lean_deg=20.0)


@dataclass(frozen=True)
class CheckRequest:
    """What `cell calibrate check` was asked for."""

    cell: str
    calibration: Path = Path("calibration")
    gates: Level = "fine"
    speed: float = 1.0
    correct: bool = False


@dataclass(frozen=True, eq=False)
class CheckedCell:
    """What came of it; `drift` is None where this was the first check of its set."""

    drift: Drift | None
    places: dict[str, Array]
    temperatures: tuple[float, ...]
    camera_temperature: float | None = None
    gates: tuple[Checked, ...] = ()
    corrected: bool = False

    @property
    def alarm(self) -> str:
        """What the moving average calls for; `reference` for the first check."""
        return "reference" if self.drift is None else self.drift.alarm

    @property
    def refused(self) -> bool:
        """Whether a sphere is beyond its gates."""
        return worst(gate.verdict for gate in self.gates) == "refuse"


def check_cell(request: CheckRequest, operator: Operator) -> CheckedCell:
    """Look at every board and sphere of the cell: how far has it wandered since the set was made?

    The spheres go the way of every measurement, through the laser, and have gates of their own. The
    first check of a set becomes its reference. Every check is one line of `drift/log.jsonl`, with
    the temperatures of the joints, and of the camera where it tells one.

    Raises:
        DocumentError: a paper is wrong, no board was seen, or the operator said no.
        DeviceError: a device failed.
    """
    belief = read_belief(request.calibration, request.cell)
    check_writable((belief.folder / LOG).parent, "checks")
    if not operator.confirm("The arm will look at the boards and spheres. Is the way clear?"):
        raise DocumentError("stopped by the operator")
    with open_station(belief.station, belief.folder, request.speed) as station:
        check_identity(belief.hand_eye.robot, station.identity, f"set {belief.set_id}")
        places: dict[str, Array] = {}
        for board in belief.targets.boards:
            places |= _place(board, belief, station, operator)
        checks = [_check_sphere(sphere, belief, station, operator, request.gates)
                  for sphere in belief.targets.spheres]
        temperatures = station.robot.state().temperatures, station.camera.temperature()
    places |= {f"{sphere.id} centre": check.result.centre
               for sphere, check in zip(belief.targets.spheres, checks, strict=True)
               if check.result is not None}
    past = read_past(belief.folder, belief.set_id)
    apply_corrections(belief.folder, past[0].get("corrections", {}) if past else {})
    drift = _judge(places, past, request.gates) if past else None
    checked = CheckedCell(drift, places, *temperatures,
                          tuple(gate for check in checks for gate in check.gates))
    _log(belief, checked)
    return replace(checked, corrected=request.correct and _correct(belief, checked, operator))


def _place(board: BoardDocument, belief: Belief, station: Station,
           operator: Operator) -> dict[str, Array]:
    """Measure three corners of a board in the base: the mean over some views."""
    design = design_of(board)
    start = plan_start(belief, design, board.rough_place)
    planned = plan_poses(belief, VIEWS, design, board.rough_place, start)
    seen = []
    for joints in (start, *(joints for _, joints in planned.targets), start):
        drive(station, free_path(belief, station.robot.state().joints, joints, start))
        ring = shoot(station).ring
        try:
            view = detect_board(ring.image, design).view
        except UnmeasurableError as error:
            operator.tell(f"{board.id}: {error.detail}")
            continue
        pose = locate_boards([view], belief.sensor.camera)[0].camera_from_board
        seen.append(belief.chain.base_from_camera(ring.base_from_flange_before, ring.joints) @ pose
                    @ design.outline)
    if not seen:
        raise DocumentError(f"the board {board.id} was not seen", source=belief.station.name)
    corners = np.mean(seen, axis=0)
    return {f"{board.id} corner {index}": corners[index] for index in range(len(corners))}


def _check_sphere(sphere: SphereDocument, belief: Belief, station: Station, operator: Operator,
                  gates: Level) -> SphereCheck:
    """Measure the centre of a sphere in the base, by the stripe, from several sides."""
    start = station.robot.state().joints
    looks = []
    for joints in (*plan_sphere(belief, sphere, start, SPHERE_VIEWS), start):
        drive(station, free_path(belief, station.robot.state().joints, joints, start))
        if joints is not start:
            looks += _look(sphere, belief, station, operator)
    return check_sphere(looks, sphere, belief.sensor, belief.chain,
                        read_gates().level(gates).sphere)


def _look(sphere: SphereDocument, belief: Belief, station: Station,
          operator: Operator) -> list[SphereLook]:
    view = shoot(station).stripe
    try:
        return [see_sphere(view.image, view.base_from_flange_before, view.joints, sphere, belief)]
    except UnmeasurableError as error:
        operator.tell(f"{sphere.id}: {error.detail}")
        return []


def _judge(places: dict[str, Array], past: list[dict[str, Any]], gates: Level) -> Drift:
    reference = {name: np.array(place) for name, place in past[0]["places"].items()}
    averages = [np.array(line["average"]) for line in past if line["average"] is not None]
    limits = read_gates().level(gates).drift_mm
    return judge_drift(reference, places, averages, {str(k): v for k, v in limits.items()})


def _log(belief: Belief, checked: CheckedCell) -> None:
    drift = checked.drift
    append_check(belief.folder, belief.set_id, {
        "alarm": checked.alarm, **_measured(checked),
        "average": None if drift is None else drift.average.tolist(),
        "left_over_mm": None if drift is None else drift.left_over})


def _measured(checked: CheckedCell) -> dict[str, Any]:
    return {"places": {name: place.tolist() for name, place in checked.places.items()},
            "joint_temperatures_c": list(checked.temperatures),
            "camera_temperature_c": checked.camera_temperature}


def _correct(belief: Belief, checked: CheckedCell, operator: Operator) -> bool:
    """Take the rigid part of a drift back in the body registrations, if it may be and is agreed to.

    The log's line comes first: a check that finds it but not all registrations finishes the work.
    """
    drift = checked.drift
    if drift is None or drift.alarm == "repeat" or not drift.correctable:
        operator.tell("Not corrected: " + ("there is no reference yet." if drift is None else
                      "check again first." if drift.alarm == "repeat" else
                      "beyond 0.3 mm or 0.03 degrees, or it bends: calibrate again."))
        return False
    corrections = plan_corrections(belief.folder, belief.set_id, drift.reference_from_now.inverse)
    shift, turn = drift.reference_from_now.distance(Transform.identity())
    if not operator.confirm(f"Correct the registrations of {', '.join(corrections) or 'nothing'} "
                            f"by {shift:.3f} mm and {np.degrees(turn):.4f} degrees?"):
        return False
    append_check(belief.folder, belief.set_id, {
        "alarm": CORRECTED, **_measured(checked), "average": None, "left_over_mm": drift.left_over,
        "corrections": corrections})
    apply_corrections(belief.folder, corrections)
    return True
