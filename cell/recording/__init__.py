"""Recordings: written while a body is measured, sealed, read back exactly, and shown.

The only room that imports rerun.
"""

from cell.recording.reader import Recording, read
from cell.recording.versions import collect_versions
from cell.recording.writer import Recorder

__all__ = ["Recorder", "Recording", "collect_versions", "read"]
