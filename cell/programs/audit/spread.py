"""Auditing many recordings: one function mapped over a list, through any standard executor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from cell.core.errors import DeviceError, DocumentError
from cell.programs.audit.log import Watch, audit_log, unwatched
from cell.programs.audit.question import Question
from cell.programs.audit.report import LogAudit, fault_of_the_program
from cell.recording.guard import guarded


def audit_each(logs: Sequence[Path], question: Question, executor: Executor | None = None,
               watch: Watch = unwatched) -> Iterator[LogAudit]:
    """Audit recordings one by one, or through an executor as they are done.

    A recording that takes its process down is refused; the others go on.
    """
    if executor is None:
        yield from (audit_log(log, question, watch) for log in logs)
        return
    futures = {executor.submit(audit_log, log.resolve(), question): log for log in logs}
    for future in as_completed(futures):
        yield _result(future, futures[future], question)


def _result(future: Future[LogAudit], log: Path, question: Question) -> LogAudit:
    try:
        return future.result()
    except BrokenProcessPool:
        return _alone(log, question)
    except Exception as error:  # noqa: BLE001  what the executor lost must not stop the others
        return fault_of_the_program(log, error)


def _alone(log: Path, question: Question) -> LogAudit:
    """Audit one recording in a process of its own: it may be the one that takes processes down."""
    try:
        return guarded(partial(audit_log, question=question), log)
    except DocumentError as error:
        return LogAudit(log, str(error))


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Give the executor of a dask cluster, whose workers see the recordings under the same path.

    Raises:
        DocumentError: dask is not installed.
        DeviceError: there is no scheduler at `address`.
    """
    try:
        from distributed import Client
    except ImportError:
        raise DocumentError('needs dask: pip install "cell-inspection[dask]"',
                            place="--cluster") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise DeviceError(f"there is no scheduler at {address}: {error}",
                          device="cluster") from None
    with client:
        yield client.get_executor()
