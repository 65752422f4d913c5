"""The audit of one recording: is it intact, and does every number come out again?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from cell.core.documents.papers import Papers
from cell.core.documents.record import Attempt, HoleRecord, Start, Stop
from cell.core.documents.result import BodyResult, Outcome
from cell.core.errors import CellError, DocumentError
from cell.metrology.judge.decide import judge_run
from cell.metrology.measure.hole import measure_hole
from cell.programs.audit.compare import Comparison, Difference, compare
from cell.programs.audit.consistency import contradictions
from cell.programs.audit.question import Question
from cell.programs.audit.report import Change, LogAudit, fault_of_the_program
from cell.recording.audit_picture import AuditPicture
from cell.recording.forms import as_recorded
from cell.recording.integrity import Check, check_chain, check_images, check_seal
from cell.recording.pages import Page, read_pages, without_images
from cell.recording.seal import Closed, Seal
from cell.recording.versions import collect_versions

JUDGING = ("job", "nominals")  # papers of a what-if that judge what was measured

Watch: TypeAlias = Callable[[int], None]
"""Told how many holes are through."""

PLAIN = Question()


def unwatched(_holes: int) -> None:
    """Watch nothing."""


def audit_log(log: Path, question: Question = PLAIN, watch: Watch = unwatched) -> LogAudit:
    """Audit one recording. Never raises: what is wrong with it is the answer, and a bug is one that
    says nothing of it, so that the others are audited all the same.

    Args:
        log: the recording.
        question: how to go about it, and what else to ask.
        watch: told how many holes are through.
    """
    checks: list[Check] = []
    try:
        seal, checks = check_seal(log, question.trusted)
        if problem := _refusal(checks, seal, question):
            return LogAudit(log, problem, checks=tuple(checks))
        pages = read_pages(log)
        audit = _Audit(log, question, next(pages))
        with audit.drawing():
            for count, page in enumerate(pages):
                audit.take(page)
                watch(count)
        return audit.close(log, seal, checks)
    except CellError as error:
        return LogAudit(log, str(error), error.exit_code, checks=tuple(checks))
    except Exception as error:  # noqa: BLE001  one bug must not keep the others from their audit
        return _stumbled(log, error, tuple(checks))


def _stumbled(log: Path, error: Exception, checks: tuple[Check, ...]) -> LogAudit:
    """Tell a recording that was altered, and may hold anything, from a bug over an intact one."""
    try:
        faults = [fault for page in read_pages(log) for fault in page.faults]
    except DocumentError as damage:
        faults = [str(damage)]
    if altered := _not_intact(checks, faults):
        return LogAudit(log, f"{altered}; what it holds now cannot be measured: {error!r}",
                        checks=checks)
    return fault_of_the_program(log, error, checks)


def _refusal(checks: list[Check], seal: Seal | None, question: Question) -> str | None:
    """Say why a recording is not even read: unsealed, or not as it was sealed."""
    failed = [f"{check.level}: {check.words}" for check in checks if check.passed is False]
    if seal is None and not failed:
        failed = [check.words for check in checks]
    return "; ".join(failed) if failed and not question.unsealed else None


def _not_intact(checks: Sequence[Check], faults: Sequence[str] = ()) -> str | None:
    failed = [*(check.words for check in checks if check.passed is False), *faults]
    return f"not intact: {'; '.join(failed)}" if failed else None


class _Audit:
    """One recording on its way through: the papers first, then hole by hole."""

    def __init__(self, log: Path, question: Question, first: Page) -> None:
        assert isinstance(first.record, Start)  # `read_pages` sees to it
        self._picture = AuditPicture(log, first.record) if question.save else None
        self._start, self._what_if = first.record, question.what_if.asks
        self._papers = question.papers(first.record)
        self._plan = (Papers.parse(self._start.papers, self._start.set_id) if self._what_if
                      else self._papers)
        self._measures_otherwise = self._papers.job.method != self._plan.job.method or any(
            self._start.papers.get(name) != text
            for name, text in question.what_if.texts.items() if name not in JUDGING)
        self._known = {hole.id for hole in self._papers.holes}
        self._page, self._faults, self._missing = first, list(first.faults), 0
        self._recorded: list[HoleRecord] = []
        self._then: list[HoleRecord] = []
        self._stop: Stop | None = None
        self._numbers: Counter[str] = Counter()
        self._differences: list[Difference] = []
        self._warnings: list[str] = []
        self._skipped = 0

    def drawing(self) -> AbstractContextManager[object]:
        """Close the picture at the end, if there is one."""
        return nullcontext() if self._picture is None else closing(self._picture)

    def take(self, page: Page) -> None:
        """Take the next page: measure its hole again, or hear how the run ended."""
        self._faults += page.faults
        if isinstance(page.record, HoleRecord):
            self._page, self._missing = page, self._missing + page.missing
            self._measure(page.record, pruned=bool(page.missing))
        elif isinstance(page.record, Stop):
            self._page, self._stop = page, page.record
        elif not page.faults:
            self._warnings.append("the end is torn: the last hole is not whole and was left out")

    def close(self, log: Path, seal: Seal | None, checks: list[Check]) -> LogAudit:
        """Judge the body again and say what came of it."""
        then = as_recorded(judge_run(self._papers, self._start, self._then))
        recorded = self._stop.result if self._stop is not None else None
        if recorded is not None and not self._what_if:
            self._tally(compare("body", recorded, then))
        if recorded is None and self._what_if:
            recorded = as_recorded(judge_run(self._papers, self._start, self._recorded))
        status = "died" if self._stop is None else self._stop.status
        found = Closed(self._page.chain, len(self._recorded), status, self._start.recording_id)
        checks = [*checks, check_chain(seal, found, self._faults),
                  check_images(seal, self._missing), self._check_records()]
        return LogAudit(
            log, _not_intact(checks[-3:]) or self._unanswered(),
            body_id=self._start.body_id, started=self._start.started, status=status,
            chain=self._page.chain, holes=len(self._recorded), checks=tuple(checks),
            numbers=self._numbers, differences=tuple(self._differences),
            versions=_versions_that_differ(self._start), warnings=tuple(self._warnings),
            skipped=self._skipped, verdict_then=then.verdict, what_if=self._what_if,
            verdict=recorded.verdict if recorded is not None else None,
            changes=_changes(recorded, then) if recorded is not None and self._what_if else ())

    def _unanswered(self) -> str | None:
        """Say why a what-if that measures otherwise has no answer: there are no images."""
        if self._skipped and self._measures_otherwise:
            return f"{self._skipped} holes cannot be measured otherwise: their images were pruned"
        return None

    def _check_records(self) -> Check:
        wrong = list(contradictions(self._plan, self._recorded, self._stop))
        return Check("records", not wrong, "; ".join(wrong) or "plan, holes and end agree")

    def _measure(self, record: HoleRecord, pruned: bool) -> None:
        self._recorded.append(without_images(record))
        if pruned:
            self._skipped += 1
            self._then.append(without_images(record))
            return
        again = record.attempts[-1:] if self._what_if else record.attempts
        before = len(self._differences)
        then = tuple(replace(attempt, outcome=self._outcome(record, attempt)) for attempt in again)
        if not self._what_if:
            for number, (was, now) in enumerate(zip(record.attempts, then, strict=True)):
                self._tally(compare(f"{record.observation.hole_id} attempt {number}", was, now))
        self._then.append(without_images(replace(record, attempts=then)))
        if self._picture is not None and (self._what_if or len(self._differences) > before):
            self._picture.add(record, then[-1].outcome)

    def _outcome(self, record: HoleRecord, attempt: Attempt) -> Outcome:
        """Measure a hole from the views of an attempt: the very function that ran live.

        A hole that was left out was not measured then, and is not now; one that is in no plan is
        named by `contradictions`, or is not asked for by another job.
        """
        papers, observation = self._papers, record.observation.first(attempt.views)
        if not attempt.views or observation.hole_id not in self._known:
            return attempt.outcome
        return measure_hole(observation, papers.hole(observation.hole_id), papers.calibration,
                            papers.job.method, np.radians(papers.job.normal_sigma_deg))

    def _tally(self, comparisons: Iterator[Comparison]) -> None:
        for comparison in comparisons:
            difference = comparison.difference
            level = "identical" if difference is None else difference.level
            self._numbers[level] += comparison.numbers
            if difference is not None:
                self._differences.append(difference)


def _versions_that_differ(start: Start) -> dict[str, tuple[str, str]]:
    here = collect_versions()
    return {name: (start.versions.get(name, "-"), here.get(name, "-"))
            for name in sorted(start.versions.keys() | here.keys())
            if start.versions.get(name) != here.get(name)}


def _changes(recorded: BodyResult, then: BodyResult) -> tuple[Change, ...]:
    was = {feature.id: feature for feature in recorded.features}
    return tuple(Change(now.id, was[now.id].verdict, now.verdict, was[now.id].deviation or {},
                        now.deviation or {})
                 for now in then.features if now.id in was)
