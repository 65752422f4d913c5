"""Sessions on the disk: what another version of the program began is named as such."""

import json

import pytest

from cell.core.errors import DocumentError
from cell.programs.calibration.kinematics import KinematicsFound
from cell.programs.calibration.session import Session


@pytest.mark.parametrize("header", [
    json.dumps({"version": 1, "cell": "demo", "what": "all", "board": {}, "targets": [["start"]]}),
    json.dumps({"version": 2, "cell": "demo", "plan": {"no_such_key": 1}}),
    json.dumps([1, 2]),
    "{ torn",
])
def test_a_session_of_another_version_is_named_once_and_clearly(tmp_path, header):
    (tmp_path / "session.json").write_text(header)
    with pytest.raises(DocumentError, match="begun by another version of the program") as refused:
        Session.read(tmp_path)
    assert len(str(refused.value).splitlines()) == 1 and "begin a new one" in str(refused.value)


@pytest.mark.parametrize(("places", "without", "with_rows", "kept"), [
    (2, 0.060, 0.030, True),
    (1, 0.060, 0.030, False),   # one place hardly tells the rows from the mount
    (3, 0.060, 0.058, False),   # by chance
    (2, 0.030, 0.060, False),
])
def test_the_arms_own_rows_are_kept_where_several_places_gain_by_them(places, without, with_rows,
                                                                     kept):
    found = KinematicsFound(None, None, places, without, with_rows)
    assert found.useful == kept
    assert ("not kept" in str(found)) != kept
