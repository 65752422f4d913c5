import os
import shutil

import pytest

from cell.archive.activation import activate, history, rollback
from cell.archive.sets import active_set, list_sets, read_set, write_set
from cell.core.errors import DocumentError


@pytest.fixture
def second_set(workplace):
    """The id of a new set beside the demo's, with another light plane."""
    return make_set(workplace, "2026-11-21T0800Z")


def make_set(workplace, created, **replaced):
    made = workplace.cell / "making"
    shutil.copytree(workplace.active_set, made)
    (made / "images").mkdir()
    (made / "images" / "0001.png").write_bytes(b"\x89PNG")
    for old, new in replaced.items():
        workplace.replace(made / "hand_eye.yaml", old, new)
    return write_set(workplace.cell, made, created)


def test_a_set_is_kept_whole_and_found_by_its_id(workplace, second_set):
    assert second_set.startswith("2026-11-21T0800Z_")
    assert list_sets(workplace.cell)[-1] == second_set
    home = workplace.cell / "sets" / second_set
    assert (home / "images" / "0001.png").exists()
    assert not (workplace.cell / "making").exists()
    assert read_set(workplace.cell, second_set).texts["sensor"] == \
        (workplace.active_set / "sensor.yaml").read_text()


@pytest.mark.parametrize("file", ["hand_eye.yaml", "images/0001.png"])
def test_a_set_that_was_changed_is_refused(workplace, second_set, file):
    changed = workplace.cell / "sets" / second_set / file
    changed.chmod(0o644)
    changed.write_bytes(changed.read_bytes() + b"\n")
    with pytest.raises(DocumentError, match=f"{file}.*immutable"):
        read_set(workplace.cell, second_set)


def test_a_set_with_another_document_is_refused(workplace, second_set):
    (workplace.cell / "sets" / second_set / "kinematics.yaml").write_text("model: ur10e\n")
    with pytest.raises(DocumentError, match=r"kinematics.yaml: added.*immutable"):
        read_set(workplace.cell, second_set)


def test_a_set_that_lost_a_file_is_refused(workplace, second_set):
    (workplace.cell / "sets" / second_set / "images" / "0001.png").unlink()
    with pytest.raises(DocumentError, match="missing"):
        read_set(workplace.cell, second_set)


def test_a_set_with_a_wrong_document_is_not_made(workplace):
    with pytest.raises(DocumentError, match=r"hand_eye.yaml.*flange_from_camera"):
        make_set(workplace, "2026-11-21T0800Z", flange_from_camera="flange_to_camera")


def test_activation_and_rollback_are_kept_in_the_history(workplace, second_set):
    first = active_set(workplace.cell)
    activate(workplace.cell, second_set, by="kim", at="2026-11-21T09:00:00Z", reason="new board")
    assert active_set(workplace.cell) == second_set
    back = rollback(workplace.cell, by="lee", at="2026-11-21T10:00:00Z")
    assert (back.set, back.previous, active_set(workplace.cell)) == (first, second_set, first)
    assert [(entry.set, entry.by) for entry in history(workplace.cell)][1:] == \
        [(second_set, "kim"), (first, "lee")]


def test_an_unknown_set_is_not_activated(workplace):
    before = (workplace.cell / "active.yaml").read_text()
    for name in ("2020-01-01", "../../demo", ""):
        with pytest.raises(DocumentError):
            activate(workplace.cell, name, by="kim", at="2026-11-21T09:00:00Z")
    assert (workplace.cell / "active.yaml").read_text() == before


def test_there_is_no_way_back_to_another_robot(workplace):
    other = make_set(workplace, "2026-11-21T0800Z", **{"20235500417": "20235500999"})
    with pytest.raises(DocumentError, match="another robot or sensor"):
        rollback(workplace.cell, other, by="lee", at="2026-11-21T10:00:00Z")


def test_a_crash_between_activation_and_its_record_is_made_good(workplace, second_set):
    activate(workplace.cell, second_set, by="kim", at="2026-11-21T09:00:00Z")
    record = workplace.cell / "history.jsonl"
    record.write_text(record.read_text().splitlines()[0] + '\n{"set": "tor')  # died while writing
    assert history(workplace.cell)[-1].set == second_set
    rollback(workplace.cell, by="lee", at="2026-11-21T10:00:00Z")
    assert [entry.by for entry in history(workplace.cell)][1:] == ["kim", "lee"]


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_cannot_be_written_leaves_the_active_set(workplace, second_set):
    before = (workplace.cell / "active.yaml").read_text()
    workplace.cell.chmod(0o555)
    try:
        with pytest.raises(DocumentError, match="cannot be written"):
            activate(workplace.cell, second_set, by="kim", at="2026-11-21T09:00:00Z")
    finally:
        workplace.cell.chmod(0o755)
    assert (workplace.cell / "active.yaml").read_text() == before


def test_a_history_that_cannot_be_written_is_said_and_a_torn_line_is_passed_over(workplace,
                                                                                 second_set):
    history_file = workplace.cell / "history.jsonl"
    activate(workplace.cell, second_set, by="A. Meier", at="2026-11-21T08:05:00Z")
    with history_file.open("a") as lines:
        lines.write('{"set": {"torn": 1}')
    assert history(workplace.cell)[-1].set == second_set
    history_file.unlink()
    history_file.mkdir()
    with pytest.raises(DocumentError, match=r"history\.jsonl"):
        activate(workplace.cell, second_set, by="A. Meier", at="2026-11-21T08:06:00Z")
