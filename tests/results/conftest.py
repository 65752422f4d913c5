"""Databases of both kinds for the tests of this room."""

from results_databases import database, url

__all__ = ["database", "url"]
