"""What a recording costs: in the measuring thread, and on the disk."""

import statistics
import time

import cv2
import pytest
from recorded_body import long_body, record_body

from cell.recording import Recorder
from cell.recording.stream import PNG

pytestmark = pytest.mark.bench

STOP_S = 1.9  # of one stop of the demo at real speed: motion, settling, exposures
SHIFT_BODIES, YEAR_SHIFTS = 420, 3 * 230


@pytest.fixture(scope="module")
def body():
    return long_body(24)


def test_what_it_costs_the_measuring_thread(tmp_path, body, capsys):
    """Measured as the cpu time of handing over, with the writer at work while the robot drives."""
    start, holes = body
    recorder, costs, whole = Recorder(tmp_path / "a.rrd", start), [], []
    for hole in holes:
        began, cpu = time.perf_counter(), time.thread_time()
        recorder.write_hole(hole)
        costs.append((time.perf_counter() - began, time.thread_time() - cpu))
        recorder.wait()
        whole.append(time.perf_counter() - began)
    with capsys.disabled():
        wall = statistics.median(cost[0] for cost in costs)
        print(f"\nrecording: hands over in {1e3 * wall:.2f} ms ({100 * wall / STOP_S:.2f} % of a "
              f"stop of {STOP_S} s), on the disk after {1e3 * statistics.median(whole):.0f} ms")


def test_bytes_a_hole_and_a_forecast(tmp_path, body, capsys):
    start, holes = body
    log = record_body(tmp_path / "a.rrd", start, holes)
    size = log.stat().st_size + log.with_name(log.name + ".seal.json").stat().st_size
    pngs = sum(len(cv2.imencode(".png", view.image, PNG)[1])
               for hole in holes for view in hole.observation.views)
    a_hole = size / len(holes)
    shift = SHIFT_BODIES * size
    with capsys.disabled():
        print(f"\nrecording: {a_hole / 1e3:.0f} kB a hole, {size / pngs:.3f} times its PNGs; "
              f"{shift / 1e9:.1f} GB a shift of {SHIFT_BODIES} bodies, "
              f"{YEAR_SHIFTS * shift / 1e12:.1f} TB a year of {YEAR_SHIFTS} shifts")
