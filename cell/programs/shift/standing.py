"""Standing in a fault: the robot is at rest, the laser off, and a person has the word."""

from __future__ import annotations

from contextlib import suppress

from cell.core.errors import DeviceError
from cell.core.ports import Fault, Order
from cell.line.registers import FAULTS
from cell.programs.shift.desk import Desk
from cell.programs.shift.faults import ADVICE
from cell.programs.shift.work import Cell
from cell.results.booking import Row
from cell.results.database import DatabaseError

PAUSE = 0.1
"""Seconds between two looks at the line."""


def stand(desk: Desk, cell: Cell, fault: Fault, detail: str, visit: Row | None = None) -> bool:
    """Bring the cell to rest in the state `fault` until a person resets it.

    Returns:
        True where the body may go on: the person said that it has not moved. False where the body
        was aborted meanwhile, or the shift was told to end.
    """
    cell.make_safe()
    opened, before = _write_down(desk, fault, detail, visit), desk.board.state
    desk.update(state=fault, fault=fault, detail=detail, instruction=ADVICE[fault])
    resumes = True
    try:
        while not desk.stopping:
            order = desk.look(PAUSE)
            if order is not None and order.command == "abort":
                resumes = False
                desk.line.answer(order)
                desk.update(detail=f"{detail} The body is given up.")
            elif order is not None and _recovered(desk, cell, order):
                _close(desk, opened, order)
                desk.update(state=before, fault="", detail="", instruction="")
                return resumes
    except KeyboardInterrupt:
        desk.interrupt()
    return False


def _recovered(desk: Desk, cell: Cell, order: Order) -> bool:
    if order.command != "reset":
        desk.line.answer(order, "not_ready")
        return False
    try:
        cell.recover()
    except DeviceError as still:
        desk.line.answer(order, "not_ready")
        desk.update(detail=f"Not yet: {still}")
        return False
    desk.line.answer(order)
    return True


def _write_down(desk: Desk, fault: Fault, detail: str, visit: Row | None) -> Row | None:
    """Record the fault; a database that is the fault itself cannot take it."""
    with suppress(DatabaseError):
        return desk.ledger.open_fault(fault, FAULTS[fault], detail, desk.clock.now(),
                                      visit["sequence"] if visit else None)
    return None


def _close(desk: Desk, opened: Row | None, order: Order) -> None:
    if opened is not None:
        with suppress(DatabaseError):
            desk.ledger.close_fault(opened, order.operator or "line", desk.clock.now())
