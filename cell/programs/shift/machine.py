"""The shift: bodies after bodies, each announced, measured, judged and released in the ledger.

    starting -> (master_due) -> ready -> measuring -> result -> ready ... -> stopped
    from everywhere into a fault state, and back by a person's reset; `bypass` lets bodies pass.

What a body has reached is in the ledger before the line hears of it. So a killed program finds on
its next start which bodies the line still waits for: those are answered first, and what was not
finished is incomplete.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Protocol

from cell.core.documents.result import BodyVerdict
from cell.core.errors import DeviceError
from cell.core.ports import LineResult, LineVerdict, Order, Refusal
from cell.programs.shift.desk import Desk
from cell.programs.shift.faults import fault_of
from cell.programs.shift.master import judge_master
from cell.programs.shift.measuring import Measuring, Outcome
from cell.programs.shift.standing import PAUSE, stand
from cell.programs.shift.work import Cell, PreparedJob
from cell.results.booking import Row, counts
from cell.results.database import DatabaseError

VERDICTS: dict[BodyVerdict, LineVerdict] = {
    "in_tolerance": "ok", "out_of_tolerance": "nok", "uncertain": "uncertain",
    "incomplete": "incomplete"}
KILLED = "the program ended while the body was measured"
COUNTED = ("measured", "out_of_tolerance", "missing", "worst")


class Archive(Protocol):
    """What the results database knows beside the ledger."""

    def approved(self, hashes: Collection[str]) -> bool:
        """Tell whether all these papers are approved."""

    def booked(self, recording_id: str) -> Row | None:
        """Find the body of a recording."""


class Shift:
    """Runs a shift over a line, a cell, a ledger and its books."""

    def __init__(self, desk: Desk, cell: Cell, measuring: Measuring,
                 archive: Archive) -> None:
        self.done = 0
        self._desk, self._cell, self._measuring = desk, cell, measuring
        self._archive = archive
        self._master_due = desk.document.master is not None
        self._since_master = 0

    def run(self, bodies: int | None = None) -> None:
        """Run until the line or a person says stop, or `bodies` bodies are through."""
        desk = self._desk
        try:
            self._clear_the_zone()
            self._guarded(self._answer_open_visits)
            while not desk.stopping and (bodies is None or self.done < bodies):
                self._idle()
                order = desk.look(PAUSE)
                if order is not None:
                    self._guarded(self._follow, order)
        except KeyboardInterrupt:
            desk.interrupt()
        finally:
            self._cell.make_safe()
            desk.update(state="stopped", instruction="", busy=False)

    def _clear_the_zone(self) -> None:
        """Drive home first: a killed run may have left the arm in the bodies' way."""
        while not self._desk.stopping and not self._desk.board.clear:
            try:
                self._cell.go_home()
                self._desk.update(clear=True)
            except DeviceError as error:
                stand(self._desk, self._cell, fault_of(error), str(error))

    def _guarded(self, step: Callable[..., None], *given: Order) -> None:
        """Take a step; where the ledger fails, stand, and begin again from what it holds."""
        try:
            step(*given)
        except DatabaseError as error:
            if stand(self._desk, self._cell, "results_lost", str(error)):
                self._guarded(self._answer_open_visits)

    def _idle(self) -> None:
        master, state, instruction = self._desk.document.master, "ready", "Ready for the next body."
        if self._desk.bypass is not None:
            state, instruction = "bypass", "Bodies pass unmeasured."
        elif self._master_due and master is not None:
            state, instruction = "master_due", f"Bring the master body (type {master.type})."
        self._desk.update(state=state, instruction=instruction, trouble=self._measuring.trouble)

    def _follow(self, order: Order) -> None:
        if order.command != "start":
            self._desk.line.answer(order, "nothing_to_do")
        elif refusal := self._refusal(order):
            self._desk.ledger.note("refused", f"body {order.body_id!r} of type {order.body_type}: "
                                   f"{refusal}", self._desk.clock.now())
            self._desk.line.answer(order, refusal)
        else:
            self._receive(order)

    def _refusal(self, order: Order) -> Refusal:
        if not order.body_present:
            return "no_body"
        if not order.body_id:
            return "no_body_id"
        if self._desk.document.job_of(order.body_type) is None:
            return "unknown_type"
        is_master = self._desk.document.is_master(order.body_type)
        if self._master_due and not is_master and self._desk.bypass is None:
            return "master_due"
        return ""

    def _receive(self, order: Order) -> None:
        desk, began = self._desk, self._desk.clock.steady()
        job = self._cell.jobs[desk.document.job_of(order.body_type) or ""]
        visit = self._take_in(order, job)
        if visit["kind"] == "bypassed":
            visit = self._judge(visit, Outcome(None, f"bypass: {desk.board.bypass}"))
        else:
            visit = self._judge(*self._measuring.measure(visit, job))
            self._measuring.leave(visit)
            self._keep_takt(visit, desk.clock.steady() - began)
        self._wait_for_release(visit)
        self._count(visit)

    def _take_in(self, order: Order, job: PreparedJob) -> Row:
        """Take a body in: it is in the ledger before the line hears that it was accepted."""
        desk = self._desk
        kind = "bypassed" if desk.bypass else \
            "master" if desk.document.is_master(order.body_type) else "body"
        visit = desk.ledger.arrive({
            "body_id": order.body_id, "body_type": order.body_type, "kind": kind,
            "arrived": desk.clock.now(),
            "trial": not self._archive.approved(tuple(job.hashes.values()))})
        desk.line.answer(order)
        return visit

    def _judge(self, visit: Row, outcome: Outcome) -> Row:
        """Write the verdict down and show it to the line."""
        verdict = outcome.result.verdict if outcome.result else "incomplete"
        if visit["kind"] == "master":
            finding = judge_master(outcome.result, self._master_limit)
            verdict = "in_tolerance" if finding.passed else \
                "incomplete" if finding.missing else "out_of_tolerance"
            outcome = Outcome(outcome.result, f"{finding} {outcome.reason}".strip())
        visit = self._desk.ledger.update_visit(
            visit, state="judged", verdict=verdict, reason=outcome.reason,
            judged=self._desk.clock.now(), **counts(outcome.result))
        self._publish(visit)
        return visit

    @property
    def _master_limit(self) -> float:
        master = self._desk.document.master
        return master.limit_mm if master else 0.0

    def _publish(self, visit: Row) -> None:
        self._desk.line.publish(LineResult(
            visit["sequence"], visit["body_id"], visit["body_type"], VERDICTS[visit["verdict"]],
            visit["measured"], visit["out_of_tolerance"], visit["missing"], visit["worst"],
            visit["trial"]))
        self._desk.add_to_strip(visit)

    def _wait_for_release(self, visit: Row) -> None:
        """Hold the result until the line has acknowledged it; no other body comes in before."""
        desk = self._desk
        desk.update(state="result", instruction="The line is to acknowledge the result.")
        while not desk.line.acknowledged(visit["sequence"]):
            order = desk.look(PAUSE / 5.0)
            if order is not None:
                desk.line.answer(order, "result_held" if order.command == "start"
                                 else "nothing_to_do")
            if desk.stopping and not desk.line.alive():
                return
        desk.ledger.update_visit(visit, state="released", released=desk.clock.now())

    def _count(self, visit: Row) -> None:
        master = self._desk.document.master
        if visit["kind"] != "master":
            self.done += 1
            self._since_master += 1
            self._master_due |= master is not None and self._since_master >= master.every
        elif visit["verdict"] == "in_tolerance":
            self._master_due, self._since_master = False, 0
        elif not self._desk.stopping:
            stand(self._desk, self._cell, "master_failed", visit["reason"], visit)

    def _keep_takt(self, visit: Row, seconds: float) -> None:
        takt = self._desk.document.takt
        if takt and seconds > takt.seconds:
            self._desk.ledger.note("takt", f"body {visit['body_id']} took {seconds:.0f} of "
                                   f"{takt.seconds:.0f} s", self._desk.clock.now())

    def _answer_open_visits(self) -> None:
        """Answer the bodies that an earlier run left without an acknowledged result."""
        desk = self._desk
        last = desk.ledger.last_time()
        if last is not None and last > desk.clock.now():
            desk.ledger.note("clock", f"the clock shows {last - desk.clock.now():.0f} s less than "
                             "the last entry of the ledger", desk.clock.now())
        for visit in desk.ledger.open_visits():
            judged = visit if visit["state"] != "measuring" else self._mark_interrupted(visit)
            self._publish(judged)
            self._wait_for_release(judged)

    def _mark_interrupted(self, visit: Row) -> Row:
        """Judge a body that a killed program left, by what its recording holds."""
        found = self._archive.booked(visit["recording_id"]) if visit["recording_id"] else None
        whole = found is not None and found["status"] == "complete" and visit["kind"] == "body"
        known = {name: found[name] for name in COUNTED} if found else {}
        return self._desk.ledger.update_visit(
            visit, state="interrupted", reason=KILLED, judged=self._desk.clock.now(), **known,
            verdict=found["verdict"] if found and whole else "incomplete")
