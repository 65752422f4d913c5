"""A session that is in order, with the camera on the arm or beside it."""

import pytest
from spoilt_sessions import session


@pytest.fixture(scope="module", params=["flange", "static"])
def good(request):
    return session(mount=request.param)
