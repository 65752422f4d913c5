"""Measure a golden recording again and write it anew: only before its format is released.

    PYTHONPATH=tests python tests/golden/measure_again.py
"""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

from recorded_body import GOLDEN, measured_anew, record_body

from cell.recording import read
from cell.recording.seal import seal_path


def main() -> None:
    start, holes = measured_anew()
    finished = read(GOLDEN).stop.finished
    with tempfile.TemporaryDirectory() as folder:
        log = record_body(Path(folder) / GOLDEN.name, replace(start, recording_id=GOLDEN.stem),
                          holes, finished=finished)
        back = read(log)
        features = {feature.id: {"verdict": feature.verdict, "measured": feature.measured,
                                 "uncertainty": feature.uncertainty}
                    for feature in back.stop.result.features}
        for old, new in ((GOLDEN, log), (seal_path(GOLDEN), seal_path(log))):
            old.unlink()
            old.write_bytes(new.read_bytes())
    accepted = {"head": back.head, "features": features}
    GOLDEN.with_suffix(".json").write_text(json.dumps(accepted, indent=1) + "\n")


if __name__ == "__main__":
    main()
