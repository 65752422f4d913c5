import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cell.core.documents.nominals_table import read_nominals
from cell.core.errors import DocumentError

HEADER = "id,x,y,z,i,j,k,diameter,thickness,side,control,tol_x,tol_y,tol_z,tol_d"
FULL = HEADER + ",class,cmm_x,cmm_y,cmm_z,cmm_d,cmm_u"
FIRST = "A1,1450.5,-722.5,776.9,0.6,-0.8,0,16,1.2,camera,xyd,0.5,0.6,,0.2"
SECOND = "A2,1250.5,-702.5,476.9,0,0,1,6.5,0.7,back,z,,,0.3,"
TABLE = f"{HEADER}\n{FIRST}\n{SECOND}\n"


def test_a_table_is_read_with_what_counts():
    first, second = read_nominals(TABLE, "sill.csv")
    np.testing.assert_array_equal(first.centre, [1450.5, -722.5, 776.9])
    assert first.nominal == {"x": 1450.5, "y": -722.5, "d": 16.0}
    assert first.tolerance == {"x": 0.5, "y": 0.6, "d": 0.2}
    assert (second.id, second.control, second.tolerance) == ("A2", {"z"}, {"z": 0.3})
    np.testing.assert_allclose(second.centre_on_seen_face, [1250.5, -702.5, 476.2])
    np.testing.assert_array_equal(second.normal_to_camera, [0, 0, -1])
    assert first.cmm is None


def test_a_reference_and_a_class_may_stand_beside():
    text = f"{FULL}\n{FIRST},critical,1450.6,,777.0,,0.005\n"
    hole, = read_nominals(text, "sill.csv")
    assert (hole.importance, hole.cmm, hole.cmm_u) == ("critical", {"x": 1450.6, "z": 777.0}, 0.005)


def test_byte_order_mark_blank_lines_spaces_and_line_ends_do_not_matter():
    spoilt = "\ufeff" + TABLE.replace("\n", "\r\n\r\n").replace(",", " , ")
    for one, other in zip(read_nominals(spoilt, "a"), read_nominals(TABLE, "b"), strict=True):
        np.testing.assert_array_equal(one.centre, other.centre)
        assert (one.id, one.tolerance) == (other.id, other.tolerance)


def test_a_normal_that_is_rounded_becomes_a_unit_vector():
    first, _ = read_nominals(TABLE.replace("0.6,-0.8,0,", "0.6,-0.803,0,"), "sill.csv")
    assert np.linalg.norm(first.normal) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(("old", "new", "words"), [
    (TABLE, "", ["empty", "expected the columns id"]),
    (TABLE, HEADER + "\n", ["line 1", "no hole"]),
    ("tol_d", "told", ["line 1", "'told' is unknown", "did you mean 'tol_d'"]),
    (",control", "", ["line 1", "missing: control"]),
    ("id,x,y", "id,x,x", ["line 1", "'x' stands twice"]),
    ("A2", "A1", ["line 3 (A1), column id", "stands twice", "line 2"]),
    ("A2", "", ["line 3, column id", "missing"]),
    ("A2", '"A\n2"', ["line 4, column id", r"'A\n2'"]),
    ("A2", "../A2", ["line 3", "column id", "'../A2'"]),
    ("-722.5", "left", ["line 2 (A1), column y", "finite number", "'left'"]),
    ("-722.5", "nan", ["line 2 (A1), column y", "finite number", "'nan'"]),
    ("-722.5", "-inf", ["line 2 (A1), column y", "finite number", "'-inf'"]),
    ("-722.5", "1e999", ["line 2 (A1), column y", "finite number"]),
    ("-722.5", "1_000", ["line 2 (A1), column y", "finite number"]),
    ("-722.5", "", ["line 2 (A1), column y", "empty"]),
    ("-722.5", '"-722,5"', ["line 2 (A1), column y", "decimal comma", "-722.5"]),
    ("-722.5", "-722,5", ["line 2", "16 cells", "15 columns", "decimal comma"]),
    ("0.5,0.6", "-0.5,0.6", ["line 2 (A1), column tol_x", "above 0", "-0.5"]),
    ("0.5,0.6", "0,0.6", ["line 2 (A1), column tol_x", "above 0"]),
    ("0.5,0.6", ",0.6", ["line 2 (A1), column tol_x", "empty"]),
    (",16,", ",-16,", ["line 2 (A1), column diameter", "above 0", "-16"]),
    (",1.2,", ",-1.2,", ["line 2 (A1), column thickness", "0 or more", "-1.2"]),
    ("0.6,-0.8,0,", "0,0,0,", ["line 2 (A1)", "normal", "zero"]),
    ("0.6,-0.8,0,", "6,-8,0,", ["line 2 (A1)", "length 1", "length 10"]),
    ("camera", "front", ["line 2 (A1), column side", "'camera' or 'back'", "'front'"]),
    ("xyd", "xyw", ["line 2 (A1), column control", "xyzd", "'xyw'"]),
    ("xyd", "xyy", ["line 2 (A1), column control", "twice"]),
    (",16,1.2,", ",0.016,0.0012,", ["line 2 (A1), column diameter", "metres"]),
    (",1.2,", ",0.0012,", ["line 2 (A1), column thickness", "metres"]),
    (",1.2,", ",1200,", ["line 2 (A1), column thickness", "at most 100"]),
    ("1450.5", "1450500", ["line 2 (A1)", "1450 m from the origin", "millimetres"]),
    ("A1", '"A1', ["not a CSV table"]),
])
def test_a_wrong_table_is_refused_by_line_column_expected_and_came(old, new, words):
    assert old in TABLE
    with pytest.raises(DocumentError) as refused:
        read_nominals(TABLE.replace(old, new, 1), "jobs/sill.csv")
    message = str(refused.value)
    assert message.startswith("jobs/sill.csv: ")
    assert not [word for word in words if word not in message], message


def test_semicolons_are_named_as_such():
    with pytest.raises(DocumentError, match="separated by semicolons: expected commas"):
        read_nominals(TABLE.replace(",", ";"), "sill.csv")


def test_a_body_of_three_millimetres_is_in_metres():
    metres = TABLE.replace("1450.5,-722.5,776.9", "1.4505,-0.7225,0.7769")
    metres = metres.replace("1250.5,-702.5,476.9", "1.2505,-0.7025,0.4769")
    with pytest.raises(DocumentError, match=r"within 0.3 mm.*metres; expected millimetres"):
        read_nominals(metres, "sill.csv")


@given(st.text(max_size=80) | st.text(alphabet='0123456789.,-+e"\n;nai', max_size=120))
def test_no_text_leads_to_anything_but_holes_or_a_refusal(text):
    for table in (text, f"{HEADER}\n{text}\n", f"{TABLE}{text}"):
        try:
            read_nominals(table, "any")
        except DocumentError as refused:
            assert str(refused).startswith("any: ")
