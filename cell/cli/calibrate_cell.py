"""`cell calibrate body` and `check`: where the body lies, and whether anything has wandered."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from cell.cli.calibrate_operator import operator_of
from cell.cli.calibrate_sets import CELL, FOLDER, JSON, REASON
from cell.cli.words import answers, console, print_json

if TYPE_CHECKING:
    from cell.programs.calibration.check import CheckedCell

ACCEPTED, REFUSED = 0, 1
YES = typer.Option(False, "--yes", help="Ask nobody: everything that was planned is agreed to.")
SPEED = typer.Option(1.0, "--speed", min=0.01, help="Run a simulated cell this many times faster "
                                                    "than real time.")
RPS = typer.Option(False, "--rps", help="Hold the body by the job's datums and their axes, as the "
                                        "drawing means it; else by a best fit over all holes with "
                                        "CMM values.")


def body(job: Path = typer.Argument(..., help="The job whose master body is in the fixture."),
         cell: str | None = typer.Option(None, help="The cell, if not the job's own."),
         rps: bool = RPS, yes: bool = YES, reason: str = REASON, speed: float = SPEED,
         as_json: bool = JSON) -> None:
    """Register the body: measure the master body's holes and lay them onto their CMM values.

    Writes calibration/<cell>/body/<job>.yaml with its uncertainty; the one before is kept.

    Exit code: 0 accepted, 1 refused, 2 bad input, 3 device fault.
    """
    from cell.programs.calibration.body import BodyRequest, register_body

    request = BodyRequest(job, cell, "rps" if rps else "best", speed=speed, reason=reason)
    with operator_of(yes) as operator:
        done = register_body(request, operator)
    registration = done.registration
    if as_json:
        print_json({"verdict": done.verdict, "written": done.written and str(done.written),
                    "base_from_body": registration.measured_from_body.matrix,
                    "residuals_mm": registration.residuals, "left_out_mm": registration.left_out,
                    "gates": [vars(gate) for gate in done.gates]})
    raise typer.Exit(ACCEPTED if done.written else REFUSED)


def check(cell: str = CELL, calibration: Path = FOLDER, yes: bool = YES, speed: float = SPEED,
          correct: bool = typer.Option(False, "--correct", help="Take the drift back in the body "
                                       "registrations: at most 0.3 mm and 0.03 degrees, logged, "
                                       "the registrations before it kept."),
          as_json: bool = JSON) -> None:
    """Look at the cell's boards and spheres again: have robot, sensor or fixture wandered?

    The first check of a set is its reference. The moving average warns at 0.05 mm, asks for a
    correction at 0.10 and stops at 0.20; nothing is corrected by itself. A sphere of known radius
    is measured through the laser as well, and held against gates of its own.

    Exit code: 0 good or first, 1 act, stop, repeat or refused, 2 bad input, 3 device fault.
    """
    from cell.programs.calibration.check import CheckRequest, check_cell

    with operator_of(yes) as operator:
        done = check_cell(CheckRequest(cell, calibration, speed=speed, correct=correct), operator)
    for gate in done.gates:
        console.print(f"{gate.verdict:6} {gate}", highlight=False)
    if as_json:
        print_json(_as_json(done))
    else:
        answers.print(_in_words(done), highlight=False)
        answers.print(_warmth(done), highlight=False)
    good = done.corrected or done.alarm in ("reference", "ok", "warn")
    raise typer.Exit(ACCEPTED if good and not done.refused else REFUSED)


def _as_json(done: CheckedCell) -> dict[str, Any]:
    drift = done.drift
    return {"alarm": done.alarm, "places": done.places,
            "shifts_mm": None if drift is None else dict(drift.shifts),
            "average_mm": None if drift is None else drift.average,
            "left_over_mm": None if drift is None else drift.left_over,
            "correctable": None if drift is None else drift.correctable,
            "corrected": done.corrected,
            "gates": [vars(gate) for gate in done.gates],
            "joint_temperatures_c": list(done.temperatures),
            "camera_temperature_c": done.camera_temperature}


def _warmth(done: CheckedCell) -> str:
    joints, camera = done.temperatures, done.camera_temperature
    arm = f"{min(joints):.0f} to {max(joints):.0f} degrees C" if joints else "unknown"
    seen = "unknown" if camera is None else f"{camera:.0f} degrees C"
    return f"joints {arm}, camera {seen}"


def _in_words(done: CheckedCell) -> str:
    if done.drift is None:
        return "the first check of this set: it is the reference from now on"
    size = float(np.linalg.norm(done.drift.average))
    taken = "; corrected, the registrations carry it from now on" if done.corrected else ""
    return (f"{done.alarm}: moving average {size:.3f} mm, left over after the rigid part "
            f"{done.drift.left_over:.3f} mm{taken}")
