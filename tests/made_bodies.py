"""Bodies that were never measured, for tests of what comes after measuring."""

import numpy as np

from cell.core.documents.record import Start, Stop
from cell.core.documents.result import BodyResult, Feature, Located, Measured, NotMeasured
from cell.results.booking import Booking


def feature_of(name: str, deviation: float, missing: bool = False) -> Feature:
    """One judged hole, off by `deviation` in x and a little in y."""
    nominal, tolerance = {"x": 1000.0, "y": -500.0, "d": 12.0}, {"x": 0.5, "y": 0.5, "d": 0.2}
    if missing:
        return Feature(name, "not_measured", NotMeasured(name, "no_stripe", "the stripe is dark"),
                       nominal, tolerance)
    found = {"x": deviation, "y": 0.1 * deviation, "d": 0.01}
    located = Located("joint", np.zeros(3), 6.0, None, np.eye(4))
    outcome = Measured(name, np.zeros(3), 12.0, np.eye(4), None, located, located, 0)
    verdict = "out_of_tolerance" if abs(deviation) > 0.5 else "in_tolerance"
    return Feature(name, verdict, outcome, nominal, tolerance,
                   measured={**{a: nominal[a] + found[a] for a in found}, "z": 77.7},
                   deviation=found, uncertainty={"x": 0.03, "y": 0.03, "z": 0.05, "d": 0.02},
                   axis_verdicts={"x": verdict, "y": "in_tolerance", "d": "in_tolerance"},
                   in_plane=abs(deviation), along_normal=0.01, true_position=2 * abs(deviation))


def booking_of(number: int, deviations=(0.1, 0.7, None), started=1.7e9, **changes) -> Booking:
    """A recording of one body with a hole for each of `deviations`; None is a missing one."""
    judged = tuple(feature_of(f"H{i}", d or 0.0, d is None) for i, d in enumerate(deviations))
    verdict = "incomplete" if None in deviations else "in_tolerance"
    start = Start(f"run-{number:06d}", f"BODY{number}", started + 60.0 * number, "set-1",
                  {"sensor": "s", "hand_eye": "h", "body": "b", "job": "j"}, {}, {}, trial=False)
    stop = Stop("complete", start.started + 40.0, len(judged),
                result=BodyResult(verdict, judged, {"residuals": np.array([0.1, 0.2])}))
    given = {"start": start, "stop": stop, "job": "demo", "cell": "demo",
             "log": f"run-{number:06d}.rrd", "seal": f"{number:064x}", **changes}
    return Booking(**given)
