"""The log of checks, and corrections in registrations: bounded in sum, finished after a crash."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from cell.archive.files import read_text
from cell.archive.papers import read_papers
from cell.core.documents.calibration import BodyDocument
from cell.core.documents.text import parse
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.programs.calibration.drift_log import append_check, read_past
from cell.programs.calibration.registrations import apply_corrections, plan_corrections

ROOT = Path(__file__).parents[2]
SHIFTED = Transform.from_parts([0.0, 0.0, 1e-4], [0.1, -0.08, 0.05])


@pytest.fixture
def folder(tmp_path):
    return Path(shutil.copytree(ROOT / "calibration" / "demo", tmp_path / "demo"))


def registration(folder):
    return parse(BodyDocument, read_text(folder / "body" / "demo.yaml"), "demo.yaml")


def test_corrections_add_up_to_their_bound_and_no_further(folder):
    before = registration(folder)
    for _ in range(2):
        apply_corrections(folder, plan_corrections(folder, "2026-11-20a", SHIFTED))
    twice = np.array(registration(folder).drift_correction)
    assert twice == pytest.approx((SHIFTED @ SHIFTED).matrix, abs=1e-9)
    with pytest.raises(DocumentError, match="calibrate again"):
        plan_corrections(folder, "2026-11-20a", SHIFTED)
    assert registration(folder).base_from_body == before.base_from_body


def test_measuring_uses_the_correction(folder):
    def base_from_body():
        return read_papers(ROOT / "jobs" / "demo.yaml",
                           calibration=folder.parent).parse().calibration.base_from_body

    before = base_from_body()
    apply_corrections(folder, plan_corrections(folder, "2026-11-20a", SHIFTED))
    assert base_from_body().matrix == pytest.approx((SHIFTED @ before).matrix)


def test_what_a_crash_left_undone_is_done_once(folder):
    planned = plan_corrections(folder, "2026-11-20a", SHIFTED)
    for _ in range(3):
        apply_corrections(folder, planned)
    assert np.array(registration(folder).drift_correction) == pytest.approx(SHIFTED.matrix)
    assert len(list((folder / "body" / "history").iterdir())) == 1


def test_registrations_of_other_sets_stay_as_they_are(folder):
    assert plan_corrections(folder, "2027-01-01a", SHIFTED) == {}


def test_a_correction_is_the_new_reference_and_a_registration_starts_anew(folder):
    for alarm in ("reference", "ok", "corrected", "warn"):
        append_check(folder, "s", {"alarm": alarm})
    append_check(folder, "other", {"alarm": "ok"})
    assert [line["alarm"] for line in read_past(folder, "s")] == ["corrected", "warn"]
    append_check(folder, "s", {"alarm": "registered"})
    assert read_past(folder, "s") == []


def test_a_line_that_was_cut_short_does_not_count(folder):
    append_check(folder, "s", {"alarm": "reference"})
    with (folder / "drift" / "log.jsonl").open("a") as log:
        log.write('{"at": "2026')
    append_check(folder, "s", {"alarm": "ok"})
    assert [line["alarm"] for line in read_past(folder, "s")] == ["reference", "ok"]
