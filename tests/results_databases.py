"""Databases of both kinds."""

import os
import uuid
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text
from sqlalchemy.exc import SQLAlchemyError

from cell.results.database import open_database

POSTGRES = os.environ.get("CELL_TEST_DATABASE", "postgresql+psycopg://127.0.0.1/test?user=root")


@pytest.fixture(params=["sqlite", "postgres"])
def url(request, tmp_path: Path):
    """An empty database: a file, or a schema of its own on the server of CELL_TEST_DATABASE."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'results.sqlite'}"
    else:
        yield from _schema_on_server()


def _schema_on_server():
    name = f"cell_{uuid.uuid4().hex[:12]}"
    try:
        engine = create_engine(POSTGRES, connect_args={"connect_timeout": 3})
        with engine.begin() as connection:
            connection.execute(text(f"CREATE SCHEMA {name}"))
    except (SQLAlchemyError, ImportError) as reason:
        pytest.skip(f"no PostgreSQL at CELL_TEST_DATABASE or here: {str(reason).splitlines()[0]}")
    yield f"{POSTGRES}{'&' if '?' in POSTGRES else '?'}options=-csearch_path%3D{name}"
    with engine.begin() as connection:
        connection.execute(text(f"DROP SCHEMA {name} CASCADE"))
    engine.dispose()


@pytest.fixture
def database(url):
    found = open_database(url)
    yield found
    found.close()
