"""The demo's documents in a folder of their own, free to be spoilt."""

from made_workplace import workplace

__all__ = ["workplace"]
