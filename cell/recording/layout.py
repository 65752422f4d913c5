"""Where things lie in a recording. The audit reads only what is named here; the rest is picture.

    /start                static   cell.Start: record, chain
    /papers/<name>        static   TextDocument: the exact text of a document
    /hole                 a hole   cell.Hole: record, chain
    /camera/<light>       a view   EncodedImage: PNG, lossless; cell.Image: sha256 of the pixels
    /stop                 static   cell.Stop: record, chain

The timeline `hole` counts the records from 0; the timeline `view` counts the exposures, so that a
retake never hides the view before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cell.core.documents.record import HoleRecord, Start, Stop


@dataclass(frozen=True)
class Place:
    """Where one kind of record lies: its entity, its archetype, whether it stands outside time."""

    path: str
    archetype: str
    kind: Any
    static: bool = True

    @property
    def record(self) -> str:
        """The column of the record itself."""
        return f"{self.archetype}:record"

    @property
    def chain(self) -> str:
        """The column of its link of the chain."""
        return f"{self.archetype}:chain"


START = Place("/start", "cell.Start", Start)
HOLE = Place("/hole", "cell.Hole", HoleRecord, static=False)
STOP = Place("/stop", "cell.Stop", Stop)

APPLICATION = "cell"
PAPERS, CAMERA = "/papers", "/camera"
IMAGES = (f"{CAMERA}/ring", f"{CAMERA}/laser")
HOLE_TIMELINE, VIEW_TIMELINE = "hole", "view"
IMAGE_ARCHETYPE = "cell.Image"
PNG, TEXT = "EncodedImage:blob", "TextDocument:text"
PIXELS = f"{IMAGE_ARCHETYPE}:sha256"


def is_audited(path: str) -> bool:
    """Tell whether an entity is read back, or only looked at."""
    return (path in (START.path, HOLE.path, STOP.path, *IMAGES)
            or path.startswith(PAPERS + "/"))
