"""`cell calibrate`: camera, light plane, hand-eye, body; sets and their history."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.table import Table

from cell.cli.calibrate_cell import SPEED, YES, body, check
from cell.cli.calibrate_operator import operator_of
from cell.cli.calibrate_sets import CELL, FOLDER, JSON, activate, diff, history, rollback
from cell.cli.words import answers, console, print_json, user_name

if TYPE_CHECKING:
    from cell.core.documents.calibration_session import What
    from cell.metrology.calibrate.hand_eye.calibration import HandEyeAnswer

ACCEPTED, REFUSED = 0, 1
STYLE = {"pass": "green", "solved": "green", "warn": "yellow", "refuse": "red"}

calibrate = typer.Typer(
    name="calibrate", no_args_is_help=True, rich_markup_mode="markdown",
    help="Calibrate the camera, the light plane, the hand-eye transform and the body registration.")


PLAN = typer.Option(None, "--plan", metavar="FILE", help="How to run the session: views, goal, "
                                                         "gates, reason; every key has a default.")
LIVE = typer.Option(False, "--live", help="Show it in a viewer on this machine: "
                                          "`cell view --live`.")
RESUME = typer.Option(False, "--resume", help="Go on with the newest session of the cell.")


@dataclass(frozen=True)
class Asked:
    """The options that all wizard commands share."""

    cell: str
    plan: Path | None
    yes: bool
    resume: bool
    speed: float
    folder: Path
    live: bool
    as_json: bool


class Gates(StrEnum):
    """Which gates judge."""

    fine = "fine"
    coarse = "coarse"


class Mount(StrEnum):
    """Where the camera sits."""

    flange = "flange"
    static = "static"


calibrate.command()(body)
calibrate.command()(check)
calibrate.command()(history)
calibrate.command()(diff)
calibrate.command()(activate)
calibrate.command()(rollback)


@calibrate.command("camera")
def camera(cell: str = CELL, plan: Path | None = PLAN, yes: bool = YES, resume: bool = RESUME,
           speed: float = SPEED, folder: Path = FOLDER, live: bool = LIVE,
           as_json: bool = JSON) -> None:
    """Calibrate the camera alone, for a look: a set needs light plane and hand-eye too (`all`).

    How soft it draws a sharp edge is measured as well: matrix, distortion, `blur`.

    Exit code: 0 accepted, 1 refused, 2 bad input or stopped, 3 device fault.
    """
    _run("camera", Asked(cell, plan, yes, resume, speed, folder, live, as_json))


@calibrate.command("light-plane")
def light_plane(cell: str = CELL, plan: Path | None = PLAN, yes: bool = YES, resume: bool = RESUME,
                speed: float = SPEED, folder: Path = FOLDER, live: bool = LIVE,
                as_json: bool = JSON) -> None:
    """Calibrate the light plane with the active camera; makes a set.

    Exit code: 0 accepted, 1 refused or not accepted, 2 bad input or stopped, 3 device fault.
    """
    _run("light-plane", Asked(cell, plan, yes, resume, speed, folder, live, as_json))


@calibrate.command("all")
def everything(cell: str = CELL, plan: Path | None = PLAN, yes: bool = YES, resume: bool = RESUME,
               speed: float = SPEED, folder: Path = FOLDER, live: bool = LIVE,
               as_json: bool = JSON) -> None:
    """Calibrate camera, light plane and hand-eye from one session; makes a set.

    Robot, TCP, payload, warm-up and the board's certificate are compared with the cell's file and
    the active set on one screen; what differs needs a reason. Then jog until the board fills the
    view. The views are planned for the least uncertainty, every move checked, and driven after you
    agree; no more of them than the goal takes. Keys between two views: p pause, r retake the last,
    s skip the next, q quit. `--live` shows it all: `cell view --live`, before or while it runs.

    Where targets.yaml has boards in two places, the arm's own rows can be found as well.

    With `--plan FILE --yes` nobody is asked. A session that was cut off goes on with `--resume`.

    Exit code: 0 accepted, 1 refused (with reasons) or not accepted, 2 bad input or stopped, 3
    device fault.
    """
    _run("all", Asked(cell, plan, yes, resume, speed, folder, live, as_json))


@calibrate.command("hand-eye")
def hand_eye(
    recorded: Path | None = typer.Option(None, "--from", metavar="FOLDER",
                                         help="Solve a recorded session instead of moving."),
    gates: Gates = typer.Option(Gates.fine, help="Judge as a fine cell (0.5 mm tolerances) or as a "
                                                 "coarse one (large robots and distances)."),
    mount: Mount | None = typer.Option(None, help="Where the camera sits, if the folder does not "
                                                  "say: on the flange, or static."),
    cell: str = CELL, plan: Path | None = PLAN, yes: bool = YES, resume: bool = RESUME,
    speed: float = SPEED, folder: Path = FOLDER, live: bool = LIVE, as_json: bool = JSON,
) -> None:
    """Find where the camera sits on the flange (or in the base, for a static camera).

    Without `--from`, the wizard takes the views with the active camera, and makes a set.

    A recorded session is a folder with base_from_flange.csv, views.npz and camera.yaml, or with
    camera_from_board.csv for poses alone. It is diagnosed before it is solved: units, conventions,
    exchanged lists, a moved board, doubtful intrinsics are named, never corrected.

    Exit code: 0 accepted, 1 refused (with reasons) or not accepted, 2 bad input or stopped, 3
    device fault.
    """
    if recorded is None:
        _run("hand-eye", Asked(cell, plan, yes, resume, speed, folder, live, as_json))
    else:
        _solve_recorded(recorded, gates, mount, as_json)


def _solve_recorded(recorded: Path, gates: Gates, mount: Mount | None, as_json: bool) -> None:
    from cell.metrology.calibrate.hand_eye.calibration import calibrate_hand_eye
    from cell.programs.calibration.recorded import read_gates, read_recorded

    read = read_recorded(recorded, None if mount is None else mount.value)
    answer = calibrate_hand_eye(read.session, read_gates().level(gates.value))
    if as_json:
        print_json(_answer_as_json(answer, read.notes))
    else:
        _show_answer(answer, read.notes)
    raise typer.Exit(REFUSED if answer.verdict == "refuse" else ACCEPTED)


def _run(what: What, asked: Asked) -> None:
    """Run the wizard, at the terminal or by a plan."""
    from cell.archive.files import read_text
    from cell.core.documents.calibration_session import CalibrationPlan
    from cell.core.documents.text import parse
    from cell.programs.calibration.wizard import Request, run_wizard

    plan = (parse(CalibrationPlan, read_text(asked.plan), str(asked.plan)) if asked.plan
            else CalibrationPlan() if asked.yes else CalibrationPlan(operator=user_name()))
    request = Request(what, asked.cell, plan, asked.folder, asked.speed, asked.resume, asked.live)
    with operator_of(asked.yes) as operator:
        finished = run_wizard(request, operator)
    solution = finished.solution
    if asked.as_json:
        print_json({"verdict": solution.verdict, "reasons": list(solution.reasons),
                    "accepted": finished.accepted, "set": finished.set_id,
                    "active": finished.active, "session": str(finished.session),
                    "gates": {step: [{**vars(gate), "value": _number(gate.value)}
                                     for gate in gates]
                              for step, gates in solution.gates.items()}})
    raise typer.Exit(ACCEPTED if finished.accepted else REFUSED)


def _answer_as_json(answer: HandEyeAnswer, notes: tuple[str, ...]) -> dict[str, Any]:
    figures = {name: _number(value) for name, value in answer.figures.items()}
    return {"verdict": answer.verdict, "reasons": list(answer.reasons), "notes": list(notes),
            **_solution_as_json(answer),
            "object_rms_mm": figures.get("object_rms_mm"),
            "holdout_rms_mm": figures.get("holdout_rms_mm"),
            "point_sigma_mm": figures.get("point_sigma_mm"),
            "working_distance_mm": figures.get("working_distance_mm"),
            "limited_by": answer.limited_by,
            "views": {"used": list(answer.used), "apart": list(answer.apart),
                      "left_out": list(answer.left_out)},
            "findings": [vars(finding) for finding in answer.findings],
            "gates": [{**vars(gate), "value": _number(gate.value)} for gate in answer.gates],
            "figures": figures}


def _solution_as_json(answer: HandEyeAnswer) -> dict[str, Any]:
    """Name the unknown by the mount; all null where nothing could be solved."""
    if answer.held_out is None:
        return {answer.unknown: None, "covariance": None}
    result = answer.held_out.result
    return {answer.unknown: result.carrier_from_camera.matrix,
            "covariance": result.covariance[:6, :6],
            answer.board: result.reference_from_board.matrix}


def _show_answer(answer: HandEyeAnswer, notes: tuple[str, ...]) -> None:
    for note in notes:
        console.print(f"[yellow]note:[/yellow] {note}", highlight=False)
    if answer.gates:
        answers.print(_gates_table(answer))
    if answer.held_out is not None:
        answers.print(f"{answer.unknown} (mm)", highlight=False)
        answers.print(answer.held_out.result.carrier_from_camera.matrix.round(5))
    for reason in answer.reasons:
        answers.print(f"- {reason}", highlight=False)
    if answer.limited_by:
        answers.print(answer.limited_by, highlight=False)
    answers.print(f"[{STYLE[answer.verdict]}]{answer.verdict}[/]", highlight=False)


def _gates_table(answer: HandEyeAnswer) -> Table:
    table = Table("figure", "value", "limit", "verdict", box=None, pad_edge=False)
    for gate in answer.gates:
        table.add_row(gate.meaning, f"{gate.value:.4g}", gate.limit,
                      f"[{STYLE[gate.verdict]}]{gate.verdict}[/]")
    return table


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
