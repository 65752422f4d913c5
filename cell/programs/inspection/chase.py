"""Chasing one hole: look, measure, and look again where that promises more."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from cell.core.documents.record import Attempt, HoleRecord
from cell.core.documents.result import Measured, NotMeasured, Outcome
from cell.core.geometry import Transform
from cell.core.observation import Light, Observation, View
from cell.metrology.measure.hole import measure_hole
from cell.metrology.measure.next_look import NextLook, decide_next
from cell.metrology.plan.body_prediction import predict_body
from cell.metrology.plan.stops import PlannedStop
from cell.programs.inspection.drive import Driver, Stand
from cell.programs.inspection.look import look
from cell.programs.inspection.prepare import Prepared
from cell.programs.station import Station


class Chase:
    """Measures single holes at a station, within the time that the job allows for chasing."""

    def __init__(self, station: Station, prepared: Prepared, driver: Driver) -> None:
        self._station, self._prepared, self._driver = station, prepared, driver
        self._time_left = prepared.papers.job.retry.time_s

    def measure(self, stop: PlannedStop, before: Sequence[HoleRecord], *,
                skip: bool = False) -> HoleRecord:
        """Drive to a stop and measure its hole.

        Args:
            stop: where the plan sends the arm.
            before: what has been measured on this body: it predicts where the hole will be.
            skip: leave the hole out, as not measured.

        Raises:
            DeviceError: a device failed.
        """
        body_from_predicted = self._predict(before)
        observation = Observation(stop.hole.id, (), body_from_predicted)
        if skip:
            dropped = NotMeasured(stop.hole.id, "dropped", "left out: the takt does not allow it")
            return HoleRecord(len(before), observation, (Attempt(0, dropped, "give_up"),))
        self._driver.go_to(self._stand(stop, body_from_predicted), stop.via)
        arrived = time.monotonic()
        record = self._chase(stop, observation, len(before))
        if len(record.attempts) > 1:
            self._time_left -= (time.monotonic() - arrived) * self._station.speed
        return record

    def _chase(self, stop: PlannedStop, observation: Observation, index: int) -> HoleRecord:
        camera = self._station.document.camera
        exposures: dict[Light, float] = {"ring": camera.exposure_ring_s,
                                         "laser": camera.exposure_laser_s}
        attempts: list[Attempt] = []
        while True:
            views = look(self._station, exposures, len(attempts))
            observation = observation.with_views(views)
            outcome = self._measure(observation, stop)
            following = self._decide(observation, outcome, stop)
            attempts.append(Attempt(len(observation.views), outcome, following.action))
            if following.action in ("accept", "give_up"):
                return HoleRecord(index, observation, tuple(attempts))
            exposures = {light: exposure * following.exposure_factor[light]
                         for light, exposure in exposures.items()}
            self._step_aside(stop, views[-1], following)

    def _measure(self, observation: Observation, stop: PlannedStop) -> Outcome:
        papers = self._prepared.papers
        return measure_hole(observation, stop.hole, papers.calibration, papers.job.method,
                            np.radians(papers.job.normal_sigma_deg))

    def _decide(self, observation: Observation, outcome: Outcome, stop: PlannedStop) -> NextLook:
        papers = self._prepared.papers
        return decide_next(observation, outcome, stop.hole, papers.job.retry, papers.calibration,
                           self._time_left)

    def _predict(self, before: Sequence[HoleRecord]) -> Transform:
        measured = [record.outcome for record in before if isinstance(record.outcome, Measured)]
        return predict_body(measured, self._prepared.papers.holes)

    def _stand(self, stop: PlannedStop, body_from_predicted: Transform) -> Stand:
        """Stand where the hole is expected: as planned, or moved with the body if that is free."""
        planned = Stand(stop.hole.id, stop.joints, stop.approach)
        shift = body_from_predicted @ stop.hole.centre_on_seen_face - stop.hole.centre_on_seen_face
        limit = self._prepared.papers.job.retry.recentre_limit_mm
        if not 0.0 < float(np.linalg.norm(shift)) <= limit:
            return planned
        base_from_body = self._prepared.papers.calibration.base_from_body
        base_from_moved = base_from_body @ body_from_predicted @ base_from_body.inverse
        return self._driver.stand_at(stop, base_from_moved @ stop.base_from_flange) or planned

    def _step_aside(self, stop: PlannedStop, last: View, following: NextLook) -> None:
        """Move the camera by the shift that the next look asks for, entering from the same side."""
        if following.camera_shift is None:
            return
        flange_from_camera = self._prepared.papers.calibration.flange_from_camera
        camera_from_moved = Transform.from_parts(np.eye(3), following.camera_shift)
        wanted = (last.base_from_flange_after @ flange_from_camera @ camera_from_moved
                  @ flange_from_camera.inverse)
        stand = self._driver.stand_at(stop, wanted)
        if stand is not None:
            self._driver.go_to(stand)
