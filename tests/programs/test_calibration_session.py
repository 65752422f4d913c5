"""Sessions on the disk: what another version of the program began is named as such."""

import json

import pytest

from cell.core.errors import DocumentError
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
