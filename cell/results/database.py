"""The database itself: SQLite in a file, or a PostgreSQL server by URL."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sqlalchemy import (
    Connection,
    Engine,
    MetaData,
    Table,
    create_engine,
    event,
    insert,
    inspect,
    select,
)
from sqlalchemy.engine import make_url
from sqlalchemy.exc import (
    ArgumentError,
    InterfaceError,
    InternalError,
    NoSuchModuleError,
    OperationalError,
    SQLAlchemyError,
)

from cell.core.errors import CellError, DocumentError
from cell.results.tables import RECORDS, SCHEMA, meta, metadata

WAIT = 5.0
"""Seconds that a statement waits for another writer, and a connection for its server."""

PASSING = (OperationalError, InterfaceError, InternalError)
"""Errors of the connection, the disk or a lock, not of what was written."""


class DatabaseError(CellError):
    """Report that the results database does not answer (`passing`: trying again may help) or
    refuses what it was given.
    """

    exit_code = 4

    def __init__(self, message: str, *, passing: bool) -> None:
        self.passing = passing
        super().__init__(message)


class Database:
    """An open results database. Use `transaction()`; close it when done."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """Open a transaction that is committed as a whole or not at all.

        Raises:
            DatabaseError: the database does not answer, or refuses.
        """
        try:
            with self._engine.begin() as connection:
                yield connection
        except SQLAlchemyError as error:
            raise DatabaseError(f"results database {self}: {_first_line(error)}",
                                passing=isinstance(error, PASSING)) from error

    def close(self) -> None:
        """Give all connections back."""
        self._engine.dispose()

    def __str__(self) -> str:
        return self._engine.url.render_as_string(hide_password=True)


def read_database(file: Path) -> Database:
    """Open an SQLite file that cannot be written, or whose folder cannot: for reading alone.

    Raises:
        DocumentError: there is none, or the schema is another one.
        DatabaseError: it cannot be read.
    """
    if not file.exists():
        raise DocumentError("there is no results database here, and none can be made: its folder "
                            "is read-only", source=str(file))
    # What is not in the file yet is in its log, which only a changing database has beside it.
    changing = file.with_name(f"{file.name}-wal").exists()
    how = "mode=ro" if changing else "immutable=1"
    database = Database(create_engine(f"sqlite:///file:{quote(str(file.resolve()))}?{how}&uri=true"))
    try:
        with database.transaction() as connection:
            check_schema(connection, str(file))
    except CellError:
        database.close()
        raise
    return database


def open_database(where: str | Path) -> Database:
    """Open the database at a URL or in an SQLite file, and create its tables where there are none.

    Raises:
        DocumentError: the URL is wrong, its driver is not installed, or the schema is another one.
        DatabaseError: it does not answer.
    """
    database = connect(where)
    try:
        with database.transaction() as connection:
            prepare(connection, str(database))
    except CellError:
        database.close()
        raise
    return database


def connect(where: str | Path) -> Database:
    """Name a database without reaching for it: the first transaction does, and may fail.

    Raises:
        DocumentError: the URL is wrong, or its driver is not installed.
    """
    return Database(_engine(where if isinstance(where, str) else f"sqlite:///{where}"))


def prepare(connection: Connection, source: str) -> None:
    """Create the tables where there are none, and refuse another schema.

    Raises:
        DocumentError: the schema is another one.
    """
    if _schema(connection) is None:
        metadata.create_all(connection)
        connection.execute(insert(meta).values(schema=SCHEMA))
    check_schema(connection, source)


def check_schema(connection: Connection, source: str) -> None:
    """Refuse a database of another schema, or without any.

    Raises:
        DocumentError: the schema is another one.
    """
    if (found := _schema(connection)) != SCHEMA:
        raise DocumentError(f"has schema {found}; this program writes {SCHEMA}: run "
                            "`cell results rebuild`", source=source)


def recreate_results(connection: Connection) -> None:
    """Empty the tables that are made from recordings; bring those of an older schema to this one,
    with the records that no recording holds.

    Raises:
        DocumentError: the schema is newer than this program.
    """
    found = _schema(connection)
    if found is not None and found > SCHEMA:
        raise DocumentError(f"the database has schema {found}, this program writes {SCHEMA}: "
                            "install a newer one")
    kept = {table: _rows_as_they_are(connection, table) for table in RECORDS}
    there = MetaData()
    there.reflect(connection)
    there.drop_all(connection, [table for name, table in there.tables.items()
                                if name in metadata.tables])
    metadata.create_all(connection)
    connection.execute(insert(meta).values(schema=SCHEMA))
    for table, rows in kept.items():
        if rows:
            connection.execute(insert(table), rows)


def _rows_as_they_are(connection: Connection, table: Table) -> list[dict[str, Any]]:
    """Read the columns that the table has here and has always had."""
    if not inspect(connection).has_table(table.name):
        return []
    names = {column["name"] for column in inspect(connection).get_columns(table.name)}
    columns = [column for column in table.columns if column.name in names]
    return [dict(row) for row in connection.execute(select(*columns)).mappings()]


def _schema(connection: Connection) -> int | None:
    if not inspect(connection).has_table(meta.name):
        return None
    return connection.execute(select(meta.c.schema)).scalar_one()


def _engine(url: str) -> Engine:
    try:
        parsed = make_url(url)
        sqlite = parsed.get_backend_name() == "sqlite"
        engine = create_engine(parsed, connect_args={"timeout": WAIT} if sqlite else
                               {"connect_timeout": int(WAIT)}, pool_pre_ping=not sqlite)
    except ImportError as error:
        raise DocumentError(f"needs a driver that is not installed ({error.name}): "
                            "pip install cell-inspection[postgres]", source=_masked(url)) from error
    except (ArgumentError, NoSuchModuleError) as error:
        raise DocumentError("expected a database URL as postgresql+psycopg://host/name",
                            source=_masked(url)) from error
    if sqlite:
        event.listen(engine, "connect", _prepare_sqlite)
    return engine


def _prepare_sqlite(connection: Any, _record: object) -> None:  # noqa: ANN401  DB-API connection
    """Let readers read while one writes, and let a commit survive a power failure."""
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _first_line(error: SQLAlchemyError) -> str:
    return (str(getattr(error, "orig", None) or error).strip().splitlines() or [repr(error)])[0]


def _masked(url: str) -> str:
    return url.rsplit("@", 1)[-1]
