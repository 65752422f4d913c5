"""Registering the body: the master body's datum holes, measured, laid onto their CMM values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from cell.archive.files import check_writable
from cell.archive.papers import read_papers
from cell.core.documents.base import as_rows
from cell.core.documents.calibration import BodyDocument
from cell.core.documents.nominals import Hole
from cell.core.documents.record import HoleRecord
from cell.core.documents.result import Measured
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError
from cell.core.geometry import Array
from cell.core.ports import Operator
from cell.metrology.calibrate.gates import Checked, Level, Ruling, check_gates, worst
from cell.metrology.judge.datum import (
    Datum,
    Registration,
    UndeterminedError,
    solve_body_registration,
)
from cell.metrology.plan.stops import PlannedStop
from cell.programs.calibration.drift_log import LOG, REGISTERED, append_check
from cell.programs.calibration.recorded import read_gates
from cell.programs.calibration.registrations import write_registration
from cell.programs.inspection.chase import Chase
from cell.programs.inspection.drive import Driver
from cell.programs.inspection.prepare import Prepared, prepare_papers
from cell.programs.station import Station, open_station

FEWEST_DATUMS = 3
LEAST_SIGMA = 0.02  # mm: no hole is measured better
COMMON = ("registration", "hand_eye", "intrinsics", "light_plane")
"""Shares that all datums have alike, and every hole measured later with the same set too: they move
the body as a whole and cancel, so they are no noise of a datum."""
MODEST = 0.25       # chi2 below which the datums agree far better than the robot promises


@dataclass(frozen=True)
class BodyRequest:
    """What `cell calibrate body` was asked for: `fit` is `best` or, by the job's datums, `rps`."""

    job: Path
    cell: str | None = None
    fit: Literal["best", "rps"] = "best"
    gates: Level = "fine"
    speed: float = 1.0
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Registered:
    """What came of it; `written` is None where it was refused."""

    registration: Registration
    gates: tuple[Checked, ...]
    verdict: Ruling
    written: Path | None


def register_body(request: BodyRequest, operator: Operator) -> Registered:
    """Measure the datum holes of the master body and find where its axes lie in the base.

    Raises:
        DocumentError: a paper is wrong, too few datums were measured, or the operator said no.
        DeviceError: a device failed.
    """
    prepared = _prepare(request)
    chosen = [stop for stop in prepared.stops if _is_datum(stop.hole, prepared, request.fit)]
    if len(chosen) < FEWEST_DATUMS:
        raise DocumentError(f"{len(chosen)} datum holes with CMM values; {FEWEST_DATUMS} at least, "
                            "six or more are wanted", source=str(request.job))
    for place in (LOG, "body/history"):
        check_writable((prepared.folder / place).parent, "registrations")
    if not operator.confirm("Is the master body in the fixture, clamped, and the way clear?"):
        raise DocumentError("stopped by the operator")
    with open_station(prepared.papers.station, prepared.folder, request.speed) as station:
        prepared.check_devices(station)
        if station.world is not None:
            station.world.deliver_master()
        datums = _measure(chosen, station, prepared, operator)
    return _conclude(request, prepared, datums, operator)


def _prepare(request: BodyRequest) -> Prepared:
    """Prepare the job with the registration that is there as a belief, whatever set it is of."""
    found = read_papers(request.job, request.cell)
    old = parse(BodyDocument, found.texts["body"], found.sources["body"])
    belief = dump(old.model_copy(update={"calibration_set": None}))
    return prepare_papers(replace(found, texts={**found.texts, "body": belief}))


def _is_datum(hole: Hole, prepared: Prepared, fit: str) -> bool:
    named = prepared.papers.job.alignment.datums
    by_cmm = hole.cmm is not None and set("xyz") <= set(hole.cmm)
    return hole.id in named if fit == "rps" else by_cmm


def _measure(stops: list[PlannedStop], station: Station, prepared: Prepared,
             operator: Operator) -> list[Datum]:
    driver = Driver(station, prepared)
    chase, records, datums = Chase(station, prepared, driver), list[HoleRecord](), list[Datum]()
    driver.go_home()
    for stop in stops:
        record = chase.measure(stop, records)
        records.append(record)
        if isinstance(record.outcome, Measured):
            datums.append(_datum(stop.hole, record.outcome, prepared))
            operator.tell(f"{len(datums):02}/{len(stops)} {stop.hole.id} measured")
        else:
            operator.tell(f"--/{len(stops)} {stop.hole.id} not measured: {record.outcome.detail}")
    driver.go_home()
    return datums


def _datum(hole: Hole, measured: Measured, prepared: Prepared) -> Datum:
    """Take a measured hole as a datum: CMM against the robot's base."""
    papers = prepared.papers
    shares = [share for source, share in measured.budget.items() if source not in COMMON]
    a, b, c = (max(LEAST_SIGMA, float(value))
               for value in np.sqrt(np.sum(np.square(shares), axis=0))[:3])
    return Datum(hole.id, _reference(hole), papers.calibration.base_from_body @ measured.centre,
                 papers.job.alignment.datums.get(hole.id, "xyz"), (a, b, c))


def _reference(hole: Hole) -> Array:
    """What the CMM measured on the master body, axis by axis; the nominal where it did not."""
    known = hole.cmm or {}
    return np.array([known.get(axis, value)
                     for axis, value in zip("xyz", hole.centre, strict=True)])


def _conclude(request: BodyRequest, prepared: Prepared, datums: list[Datum],
              operator: Operator) -> Registered:
    try:
        registration = solve_body_registration(datums)
    except (UndeterminedError, ValueError) as error:
        raise DocumentError(f"the datums do not hold the body: {error}",
                            source=str(request.job)) from None
    figures = body_figures(registration, prepared.papers.holes)
    gates = check_gates(figures, read_gates().level(request.gates).body)
    verdict = worst(gate.verdict for gate in gates)
    for gate in gates:
        operator.tell(f"  {gate.verdict:6} {gate.meaning}: {gate.value:.3g}, wanted {gate.limit}")
    if registration.chi2 is not None and 0.0 < registration.chi2 < MODEST:
        operator.tell(f"The datums agree {registration.chi2 ** -0.5:.0f} times better than their "
                      "uncertainty says: the robot's share is a bound over all its reach, not over "
                      "this body.")
    operator.tell(f"verdict: {verdict}")
    reason = request.reason or (operator.ask("There are warnings. Why is this registration "
                                             "acceptable? (empty: it is not)", "")
                                if verdict == "warn" else "")
    if verdict == "refuse" or (verdict == "warn" and not reason.strip()):
        return Registered(registration, gates, verdict, None)
    return Registered(registration, gates, verdict, _write(registration, prepared, datums))


def body_figures(registration: Registration, holes: tuple[Hole, ...]) -> dict[str, float]:
    """What the gates of the registration look at; nothing can be left out of six constraints."""
    sigmas = registration.predict_sigma(np.array([hole.centre for hole in holes]))
    left_out = [miss for miss in registration.left_out.values() if miss is not None]
    worst_datum = max(float(np.linalg.norm(list(axes.values())))
                      for axes in registration.residuals.values())
    figures = {"rms_mm": registration.rms, "worst_datum_mm": worst_datum,
               "redundancy": registration.redundancy,
               "hole_sigma_mm": float(np.sqrt(np.sum(sigmas ** 2, axis=1)).max())}
    return figures | ({"left_out_mm": max(left_out)} if left_out else {})


def _write(registration: Registration, prepared: Prepared, datums: list[Datum]) -> Path:
    """Replace the registration; drift counts from here, so the next check is a new reference."""
    job = prepared.papers.job.name
    file = prepared.folder / "body" / f"{job}.yaml"
    rows = registration.covariance_of_measured_from_body
    document = BodyDocument(
        base_from_body=as_rows(registration.measured_from_body),
        calibration_set=prepared.papers.set_id,
        covariance=tuple(tuple(float(value) for value in row) for row in rows),  # type: ignore[arg-type]
        datums=tuple(datum.id for datum in datums))
    append_check(prepared.folder, prepared.papers.set_id, {"alarm": REGISTERED, "job": job})
    write_registration(file, document)
    return file
