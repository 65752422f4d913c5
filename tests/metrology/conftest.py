"""The demo's documents in a folder of their own, free to be spoilt, and as a run has them."""

import pytest
from made_workplace import workplace

__all__ = ["workplace"]


@pytest.fixture
def papers(workplace):
    return workplace.papers()
