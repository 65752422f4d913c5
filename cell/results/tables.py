"""The tables, as one picture of the schema.

    meta          one row: the version of this schema
    calibrations  one row a calibration set as used: hashes of its papers
    bodies        one row a recording          <- features  one row a hole  <- axes  one row an axis
    approvals     who approved which papers, and when
    visits        one row a body that the line announced: what became of it
    faults        every fault state, and who confirmed the recovery
    bypasses      who let bodies pass unmeasured, why, since when and for how long at most
    notices       what an auditor should know: the clock stepped back, a takt was missed

Times are seconds since 1970 (UTC), lengths mm, uncertainties standard (k = 1).
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
)

SCHEMA = 1

metadata = MetaData()
Key = BigInteger().with_variant(Integer, "sqlite")  # SQLite counts up only what is called INTEGER


def _words(name: str, *, nullable: bool = False) -> Column[str]:
    return Column(name, String(200), nullable=nullable)


def _counts() -> tuple[Column[int], Column[int], Column[int], Column[float]]:
    return (Column("measured", Integer, nullable=False),
            Column("out_of_tolerance", Integer, nullable=False),
            Column("missing", Integer, nullable=False), Column("worst", Float))


meta = Table("meta", metadata, Column("schema", Integer, nullable=False))

calibrations = Table(
    "calibrations", metadata,
    Column("hash", String(64), primary_key=True),
    _words("cell"), _words("set_id"), Column("first_used", Float, nullable=False))

bodies = Table(
    "bodies", metadata,
    Column("key", Key, primary_key=True),
    Column("recording_id", String(200), nullable=False, unique=True),
    _words("body_id"), _words("job"), _words("cell"), _words("set_id"),
    Column("calibration", ForeignKey("calibrations.hash"), nullable=False),
    Column("started", Float, nullable=False), Column("finished", Float),
    _words("status"), _words("verdict"),
    Column("trial", Boolean, nullable=False), Column("simulated", Boolean, nullable=False),
    *_counts(), Column("reason", Text, nullable=False), _words("log"), _words("seal"),
    Column("alignment", Text, nullable=False),
    Index("bodies_by_time", "started"), Index("bodies_by_body", "body_id"))

features = Table(
    "features", metadata,
    Column("body", ForeignKey("bodies.key", ondelete="CASCADE"), primary_key=True),
    Column("feature", String(200), primary_key=True),
    Column("position", Integer, nullable=False),
    _words("verdict"), _words("reason", nullable=True), Column("detail", Text),
    Column("in_plane", Float), Column("along_normal", Float), Column("true_position", Float))

axes = Table(
    "axes", metadata,
    Column("body", ForeignKey("bodies.key", ondelete="CASCADE"), primary_key=True),
    Column("feature", String(200), primary_key=True),
    Column("axis", String(1), primary_key=True),
    Column("nominal", Float), Column("tolerance", Float), Column("measured", Float),
    Column("deviation", Float), Column("uncertainty", Float), Column("bias", Float),
    _words("verdict", nullable=True),
    Index("axes_by_feature", "feature", "axis", "body"))

approvals = Table(
    "approvals", metadata,
    Column("hash", String(64), primary_key=True),
    _words("kind"), _words("name"), _words("approved_by"),
    Column("approved_at", Float, nullable=False), Column("withdrawn_at", Float),
    Column("note", Text, nullable=False))

visits = Table(
    "visits", metadata,
    Column("cell", String(200), primary_key=True),
    Column("sequence", Integer, primary_key=True, autoincrement=False),
    _words("shift"), _words("body_id"), Column("body_type", Integer, nullable=False),
    _words("kind"), _words("state"), Column("arrived", Float, nullable=False),
    _words("recording_id", nullable=True), _words("verdict", nullable=True),
    Column("trial", Boolean, nullable=False),
    *_counts(),
    Column("judged", Float), Column("released", Float), Column("reason", Text, nullable=False))

faults = Table(
    "faults", metadata,
    Column("id", String(32), primary_key=True),
    _words("cell"), _words("shift"), Column("at", Float, nullable=False), _words("state"),
    Column("code", Integer, nullable=False), Column("detail", Text, nullable=False),
    Column("sequence", Integer), Column("recovered_at", Float),
    _words("recovered_by", nullable=True))

bypasses = Table(
    "bypasses", metadata,
    Column("id", String(32), primary_key=True),
    _words("cell"), _words("shift"), _words("requested_by"), Column("reason", Text, nullable=False),
    Column("since", Float, nullable=False), Column("until", Float, nullable=False),
    Column("ended", Float), _words("ended_by", nullable=True))

notices = Table(
    "notices", metadata,
    Column("id", String(32), primary_key=True),
    _words("cell"), _words("shift"), Column("at", Float, nullable=False), _words("kind"),
    Column("detail", Text, nullable=False))

RECORDS = (approvals, visits, faults, bypasses, notices)
"""What no recording holds: it stays through a rebuild."""
