"""What must be right before anything moves: one screen, each line with a verdict.

Residuals cannot show a wrong board scale, an active TCP offset, another payload or a cold arm: so
they are compared with the cell's file and with the active set, and a difference needs a reason.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Literal

import numpy as np

from cell.core.documents.calibration_session import Precondition
from cell.core.documents.papers import PAYLOAD_TOLERANCE_KG, TCP_TOLERANCE
from cell.core.documents.targets import BoardDocument
from cell.core.errors import DocumentError
from cell.core.ports import Operator, RobotIdentity
from cell.programs.calibration.belief import Belief
from cell.programs.calibration.session import VIEWS

Verdict = Literal["pass", "asked", "warn", "refuse"]
WIDE = 30     # letters of what was found
COLDER = 4.0  # K: a metre of steel or aluminium is then some 0.05 to 0.1 mm shorter
HAND_EYE_TOO = "calibrate `hand-eye` or `all`: the light plane alone would keep the old hand-eye"


def check_preconditions(what: str, belief: Belief, boards: Sequence[BoardDocument],
                        identity: RobotIdentity, temperatures: Sequence[float], today: date,
                        ) -> tuple[Precondition, ...]:
    """Compare what the controller says with the cell's file, the active set, the certificates."""
    return (*_robot(what, belief, identity), _sensor(what, belief),
            *(_certificate(board, today) for board in boards),
            _warmth(belief.folder / "sets" / belief.set_id / VIEWS, temperatures))


def show_preconditions(lines: Sequence[Precondition], operator: Operator) -> None:
    """Show them as one table that fits a terminal of 80 columns."""
    rows = [("", "", "found", "wanted"), *((one.verdict, one.item, _cut(one.found), one.wanted)
                                           for one in lines)]
    wide = [max(len(row[column]) for row in rows) for column in range(3)]
    for *row, wanted in rows:
        shown = "  ".join(text.ljust(width) for text, width in zip(row, wide, strict=True))
        operator.tell(f"  {shown}  {wanted}")


def accept_preconditions(lines: Sequence[Precondition], reason: str, operator: Operator) -> str:
    """Return why what is not met is accepted; nothing where all is met.

    Raises:
        DocumentError: something cannot be accepted, or no reason was given; nothing has moved.
    """
    refused = [one for one in lines if one.verdict == "refuse"]
    if refused:
        raise DocumentError("; ".join(f"{one}: {one.advice}" for one in refused),
                            source="preconditions")
    warned = [one for one in lines if one.verdict == "warn"]
    for one in warned:
        operator.tell(f"! {one}. {one.advice}")
    if not warned:
        return ""
    given = reason or operator.ask("Why may it be calibrated all the same? The reason goes into "
                                   "the set. (empty: it may not)", "")
    if not given.strip():
        raise DocumentError("not accepted without a reason (at the terminal, or `reason` in the "
                            f"plan): {'; '.join(map(str, warned))}", source="preconditions")
    return given.strip()


def _robot(what: str, belief: Belief, found: RobotIdentity) -> Iterator[Precondition]:
    """A model or serial other than that of cell.yaml is another cell; other differences from the
    active set are found anew, where the hand-eye is.
    """
    settings, record = belief.station.robot, belief.hand_eye.robot
    other: Verdict = "refuse" if what == "light-plane" else "warn"
    advice = HAND_EYE_TOO if what == "light-plane" else "The active set was made otherwise"
    yield _same("robot", found.model, settings.model, "refuse", "Correct cell.yaml first.")
    if settings.serial is not None:
        yield _same("serial", found.serial, settings.serial, "refuse", "Correct cell.yaml first.")
    if found.serial != record.serial or settings.serial is None:
        yield _same("serial of the set", found.serial, record.serial, other, f"{advice}: has the "
                    "robot been exchanged?")
    yield _same("kinematics", found.kinematics_checksum,
                record.kinematics_checksum or found.kinematics_checksum, other,
                f"{advice}: has the arm been repaired or calibrated?", _short)
    tcp = bool(np.allclose(found.tcp_offset, record.tcp_offset, rtol=0.0, atol=TCP_TOLERANCE))
    yield Precondition(item="TCP offset", found=_row(found.tcp_offset),
                       wanted=_row(record.tcp_offset), verdict="pass" if tcp else other,
                       advice="" if tcp else f"{advice}: which TCP is active at the controller?")
    payload = abs(found.payload_kg - record.payload_kg) <= PAYLOAD_TOLERANCE_KG
    yield Precondition(item="payload", found=f"{found.payload_kg:g} kg",
                       wanted=f"{record.payload_kg:g} kg", verdict="pass" if payload else other,
                       advice="" if payload else f"{advice}: the arm bends with its load.")


def _sensor(what: str, belief: Belief) -> Precondition:
    ours, theirs = belief.sensor_document.serial or "-", belief.hand_eye.sensor_serial or "-"
    return _same("sensor", ours, theirs if theirs != "-" else ours,
                 "refuse" if what == "light-plane" else "warn",
                 "sensor.yaml and hand_eye.yaml of the active set are of two sensors.")


def _certificate(board: BoardDocument, today: date) -> Precondition:
    """The size of the squares is the scale of everything, and no residual shows it."""
    item, wanted = f"board {board.id}", "valid today"
    name = _until(board) if board.certificate else "no certificate"
    if board.certificate and _is_valid(board, today):
        return Precondition(item=item, found=name, wanted=wanted)
    return Precondition(item=item, found=name, wanted=wanted, verdict="warn", advice=(
        "Measure ten squares with a caliper and give the figure as the reason: a board 0.2 % too "
        "large puts the camera half a millimetre off, and no residual shows it."))


def _until(board: BoardDocument) -> str:
    return f"valid until {board.certified_until}" if board.certified_until else "without a last day"


def _is_valid(board: BoardDocument, today: date) -> bool:
    try:
        return date.fromisoformat(board.certified_until or "") >= today
    except ValueError:
        return False


def _warmth(views: Path, temperatures: Sequence[float]) -> Precondition:
    """Hold the joints' temperatures against those that the active set was made at."""
    found = _degrees(temperatures)
    known = _temperatures_in(views)
    if not known or len(known) != len(temperatures):
        return Precondition(item="joints", found=found, wanted="warm", verdict="asked")
    colder = float(np.max(np.subtract(known, temperatures)))
    if colder <= COLDER:
        return Precondition(item="joints", found=found, wanted=f"{_degrees(known)} then")
    return Precondition(item="joints", found=found, wanted=f"{_degrees(known)} then",
                        verdict="warn", advice=f"A joint is {colder:.0f} K colder than when the "
                        "active set was made: let the arm move for half an hour.")


def _temperatures_in(views: Path) -> list[float]:
    """Read the joints' temperatures at the first view of a set; sets are of many versions."""
    try:
        with views.open() as lines:
            return [float(value) for value in json.loads(next(lines)).get("temperatures", ())]
    except (OSError, ValueError, TypeError, AttributeError, StopIteration):
        return []


def _same(item: str, found: str, wanted: str, otherwise: Verdict, advice: str,
          shown: Callable[[str], str] = str) -> Precondition:
    line = Precondition(item=item, found=shown(found), wanted=shown(wanted))
    return line if found == wanted else line.model_copy(update={"verdict": otherwise,
                                                                "advice": advice})


def _short(checksum: str) -> str:
    return checksum if len(checksum) <= 24 else f"{checksum[:8]}...{checksum[-8:]}"


def _row(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _degrees(temperatures: Sequence[float]) -> str:
    if not temperatures:
        return "not told"
    return f"{min(temperatures):.0f} to {max(temperatures):.0f} C"


def _cut(text: str) -> str:
    return text if len(text) <= WIDE else text[:WIDE - 3] + "..."
