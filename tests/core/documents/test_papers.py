import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_workplace import Workplace

from cell.core.documents.calibration import HandEyeDocument, SensorDocument
from cell.core.documents.papers import Papers, check_identity
from cell.core.documents.text import dump, parse
from cell.core.errors import DocumentError
from cell.core.ports import RobotIdentity


def test_the_papers_say_the_same_from_disk_and_from_a_recording(workplace):
    live = workplace.papers()
    audited = Papers.parse(dict(live.texts), live.set_id)
    assert audited.job == live.job
    assert audited.calibration.hand_eye == live.calibration.hand_eye
    assert [hole.id for hole in audited.holes] == [hole.id for hole in live.holes]
    assert live.sources["hand_eye"].endswith("hand_eye.yaml")


def test_the_holes_come_in_the_order_of_the_stops(workplace):
    papers = workplace.papers()
    assert [hole.id for hole in papers.planned_holes] == [stop.hole for stop in papers.job.stops]
    without = dataclasses.replace(papers, job=papers.job.model_copy(update={"stops": ()}))
    assert without.planned_holes == without.holes


@pytest.mark.parametrize(("document", "old", "new", "words"), [
    ("job", "hole: SI3}", "hole: SI33}", ["line 12, stops[5].hole", "'SI33'", "not among"]),
    ("job", "hole: SI4}", "hole: SI3}", ["stops[6].hole", "'SI3' has two stops"]),
    ("job", "stops:", "alignment: {datums: {XX: xyz}}\nstops:", ["alignment.datums.XX", "'XX'"]),
    ("job", "stops:", "alignment: {datums: {SI1: xw}}\nstops:", ["alignment.datums.SI1", "'xw'"]),
    ("job", "  - {hole: SI1}\n", "", ["alignment.datums.SI1", "never measured"]),
    ("job", "stops:", "alignment: {method: rps, datums: {SI1: xyz}}\nstops:", ["at least 6", "3"]),
    ("job", "stops:", "alignment: {method: best_fit}\nstops:", ["at least 3 datums", "came 0"]),
    ("hand_eye", "model: ur10e", "model: ur5e", ["robot.model", "ur5e", "ur10e"]),
    ("hand_eye", "20235500417", "20235500999", ["line 9, robot.serial", "20235500999"]),
    ("hand_eye", "LS-0417", "LS-0001", ["sensor_serial", "LS-0001", "LS-0417"]),
    ("body", "calibration_set: ", "calibration_set: x", ["calibration_set", "register the body"]),
])
def test_documents_that_do_not_belong_together_are_refused(workplace, document, old, new, words):
    papers = workplace.papers()
    texts = dict(papers.texts)
    if old.startswith("  - {hole: SI1"):
        texts["job"] = texts["job"].replace("stops:", "alignment: {datums: {SI1: xyz}}\nstops:")
    assert old in texts[document]
    texts[document] = texts[document].replace(old, new, 1)
    with pytest.raises(DocumentError) as refused:
        Papers.parse(texts, papers.set_id, papers.sources)
    assert refused.value.source == papers.sources[document]
    assert not [word for word in words if word not in str(refused.value)], str(refused.value)


def test_an_offset_of_an_unknown_hole_is_refused(workplace):
    papers = workplace.papers()
    offset = ("offsets:\n  - {hole: XX, axis: x, value_mm: 0.04, spread_mm: 0.01, sample_size: 5, "
              "joints_deg: [1, 2, 3, 4, 5, 6], learnt: 2026-11-01, expires: 2027-11-01}\n")
    with pytest.raises(DocumentError, match=r"offsets\[0\].hole.*'XX'"):
        Papers.parse({**papers.texts, "offsets": offset}, papers.set_id)


def test_papers_that_are_missing_are_named(workplace):
    papers = workplace.papers()
    texts = {name: text for name, text in papers.texts.items() if name != "hand_eye"}
    with pytest.raises(DocumentError, match="missing: hand_eye"):
        Papers.parse(texts, papers.set_id)


@pytest.mark.parametrize(("field", "value", "words"), [
    ("camera_matrix", ((0.0, 0.0, 1.0), (0.0, 1.0, 1.0), (0.0, 0.0, 1.0)), "fx, fy > 0"),
    ("light_plane", (1.0, 0.0, 0.5, 134.0), "in front of the camera"),
    ("light_plane", (1.0, 0.0, 0.0, -134.0), "in front of the camera"),
    ("light_plane_covariance", ((1.0, 0.0), (0.0, 1.0)), "4 rows"),
    ("light_plane_covariance", tuple(map(tuple, (-np.eye(4)).tolist())), "no negative variance"),
    ("light_plane_covariance", tuple(map(tuple, np.triu(np.ones((4, 4))).tolist())), "symmetric"),
    ("image_size", (8, 576), "greater than or equal to 16"),
])
def test_a_sensor_that_cannot_be_is_refused(workplace, field, value, words):
    text = dump(workplace.papers().calibration.sensor)
    spoilt = parse(SensorDocument, text, "s").model_copy(update={field: value})
    with pytest.raises(DocumentError, match=words):
        parse(SensorDocument, dump(spoilt), "sensor.yaml")


@pytest.mark.parametrize(("row", "words"), [
    ((2.0, 0.0, 0.0, 10.0), "orthogonal unit vectors"),
    ((-0.977216621, 0.207713805, 0.043619387, 0.0), "mirror image"),
])
def test_a_matrix_that_is_no_rotation_is_refused(workplace, row, words):
    hand_eye = workplace.papers().calibration.hand_eye
    rows = (row, *hand_eye.flange_from_camera[1:])
    spoilt = hand_eye.model_copy(update={"flange_from_camera": rows})
    with pytest.raises(DocumentError, match=f"flange_from_camera.*{words}"):
        parse(HandEyeDocument, dump(spoilt), "hand_eye.yaml")


def identity_of(record, **other):
    right = RobotIdentity(record.model, record.serial, "5.17", record.kinematics_checksum,
                          record.payload_kg, record.tcp_offset)
    return dataclasses.replace(right, **other)


def test_the_robot_that_was_calibrated_is_accepted(workplace):
    record = workplace.papers().calibration.hand_eye.robot
    check_identity(record, identity_of(record))
    unnamed = record.model_copy(update={"kinematics_checksum": ""})
    check_identity(unnamed, identity_of(record, kinematics_checksum="a1"))


@pytest.mark.parametrize(("field", "value", "words"), [
    ("model", "ur5e", "robot.model.*ur10e.*ur5e"),
    ("serial", "20235500418", "robot.serial.*20235500417.*20235500418"),
    ("tcp_offset", (0.0, 0.0, 120.0, 0.0, 0.0, 0.0), "robot.tcp_offset.*120"),
    ("payload_kg", 1.0, "robot.payload_kg.*3.2.*1.0"),
    ("kinematics_checksum", "b2", "robot.kinematics_checksum.*b2"),
])
def test_another_robot_is_refused(workplace, field, value, words):
    record = workplace.papers().calibration.hand_eye.robot
    with pytest.raises(DocumentError, match=f"sets/1/hand_eye.yaml: {words}"):
        check_identity(record, identity_of(record, **{field: value}), "sets/1/hand_eye.yaml")


SCRAP = st.sampled_from(["", "~", "[]", "{}", "-1", "1e999", ".nan", "[[1]]", "true", "x", "'", "{",
                         "&a", "*a", "!!set {a}", "- ", "? x", "\t", "0", "1" * 5000, ": :", "é"])


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    return Workplace.in_folder(tmp_path_factory.mktemp("right")).papers()


@given(st.data())
@settings(max_examples=60)
def test_no_scrap_in_any_document_leads_past_papers_or_a_refusal(right, data):
    """One word of one document is replaced, wherever it stands."""
    name = data.draw(st.sampled_from(sorted(right.texts)))
    words = re.split(r"(\s+|,|:|\[|\])", right.texts[name])
    words[data.draw(st.integers(0, len(words) - 1))] = data.draw(SCRAP)
    try:
        Papers.parse({**right.texts, name: "".join(words)}, right.set_id)
    except DocumentError as refused:
        assert refused.source in right.texts
