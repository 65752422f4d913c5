import os

import pytest

from cell.archive.files import read_text, replace_text
from cell.archive.papers import read_papers
from cell.core.errors import DocumentError


def refusal(workplace, cell=None):
    with pytest.raises(DocumentError) as refused:
        read_papers(workplace.job, cell)
    return str(refused.value)


def test_the_texts_are_the_files_to_the_letter(workplace):
    found = read_papers(workplace.job)
    assert found.texts["job"] == workplace.job.read_text()
    assert found.texts["nominals"] == workplace.nominals.read_text()
    assert found.folder.samefile(workplace.cell)
    assert set(found.texts) == {"job", "nominals", "cell", "sensor", "hand_eye", "body"}


@pytest.mark.parametrize("name", ["../demo.csv", "/etc/passwd", "sub/../../demo.csv", "link.csv"])
def test_a_path_that_leaves_the_folder_of_the_job_is_refused(workplace, name):
    (workplace.folder / "demo.csv").write_text(workplace.nominals.read_text())
    (workplace.folder / "jobs" / "link.csv").symlink_to(workplace.folder / "demo.csv")
    workplace.replace(workplace.job, "nominals: demo.csv", f"nominals: {name}")
    assert "leaves" in refusal(workplace)


def test_nominals_that_are_missing_are_named(workplace):
    workplace.nominals.unlink()
    assert "jobs/demo.csv: there is no such file" in refusal(workplace)


def test_a_folder_in_place_of_a_file_is_refused(workplace):
    workplace.nominals.unlink()
    workplace.nominals.mkdir()
    assert "demo.csv: cannot be read" in refusal(workplace)


def test_bytes_that_are_no_text_are_refused_by_line(workplace):
    workplace.nominals.write_bytes(b"id,x,y,z\n\xff\xfe\x00")
    assert "demo.csv: line 2: expected UTF-8" in refusal(workplace)


@pytest.mark.parametrize("cell", ["nowhere", "../demo", "", "demo/sets"])
def test_an_unknown_cell_is_refused(workplace, cell):
    with pytest.raises(DocumentError):
        read_papers(workplace.job, cell or "..")


def test_an_unknown_cell_is_refused_with_the_known_ones(workplace):
    assert "known: demo" in refusal(workplace, "nowhere")


def test_an_active_set_that_leads_elsewhere_is_refused(workplace):
    (workplace.cell / "active.yaml").write_text("set: ../../demo\n")
    assert "does not name a set" in refusal(workplace)


def test_an_active_set_that_is_gone_is_refused(workplace):
    (workplace.cell / "active.yaml").write_text("set: 2020-01-01\n")
    assert "there is no set '2020-01-01'; known: 2026" in refusal(workplace)


def test_nominals_that_lead_in_a_circle_are_refused(workplace):
    workplace.nominals.unlink()
    workplace.nominals.symlink_to(workplace.nominals.name)
    assert "jobs/demo.csv: cannot be read" in refusal(workplace)


@pytest.mark.timeout(5)
def test_a_pipe_is_not_waited_for(workplace):
    workplace.nominals.unlink()
    os.mkfifo(workplace.nominals)
    assert "jobs/demo.csv: expected a file; came a pipe" in refusal(workplace)


def test_a_text_without_end_is_refused(tmp_path):
    large = tmp_path / "large.yaml"
    large.write_bytes(b"a" * 10_000_001)
    with pytest.raises(DocumentError, match="at most 10 MB"):
        read_text(large)


def test_a_text_is_replaced_as_a_whole(tmp_path):
    file = tmp_path / "active.yaml"
    replace_text(file, "set: a\n")
    replace_text(file, "set: b\n")
    assert [path.name for path in tmp_path.iterdir()] == ["active.yaml"]
    assert file.read_text() == "set: b\n"
