"""How long the line waits for a verdict after the last image, at real-time speed."""

from statistics import median

import pytest
from made_station_shift import short_shift

from cell.programs.results import opened
from cell.programs.shift.run import ShiftRequest, run_shift
from cell.recording import read
from cell.results.ledger import Ledger
from cell.results.tables import visits

BODIES = 5


@pytest.mark.bench
@pytest.mark.timeout(900)
def test_from_the_last_image_to_the_verdict(tmp_path, monkeypatch, capsys):
    """From the exposure of the last image to the result on the line, and its parts."""
    monkeypatch.chdir(tmp_path)
    _, shift, _ = short_shift(tmp_path, 3, ("BP5", "BP1", "BP3", "BP2", "SI3", "SI4"))
    logs = tmp_path / "logs"
    run_shift(ShiftRequest(shift, logs, simulate=True, bodies=BODIES), lambda board: None, print)
    with opened(logs) as database:
        came = Ledger(database, "demo", "short").rows(visits)
    measuring, closing = [], []
    for row in came:
        recording = read(logs / f"{row['recording_id']}.rrd")
        measuring.append(recording.stop.finished - recording.holes[-1].observation.views[-1].time)
        closing.append(row["judged"] - recording.stop.finished)
    whole = [a + b for a, b in zip(measuring, closing, strict=True)]
    with capsys.disabled():
        print(f"\n{BODIES} bodies at real-time speed: last image to verdict {median(whole):.2f} s "
              f"median, {max(whole):.2f} s at most; of it exposing and measuring "
              f"{median(measuring):.2f} s, judging, closing and sealing {median(closing):.2f} s")
    assert len(came) == BODIES
