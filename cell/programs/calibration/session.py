"""A calibration session on disk: one synced line a view, so that a crash costs one view at most."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import cv2

from cell.archive.files import append_line, read_json_lines, read_text, replace_text, sync
from cell.archive.images import read_image
from cell.core.documents.calibration_session import SCHEMA, SessionHeader, ViewRecord
from cell.core.errors import DocumentError
from cell.core.observation import Image

HEADER, VIEWS, IMAGES, OUTCOME = "session.json", "views.jsonl", "images", "outcome.txt"


@dataclass(frozen=True, eq=False)
class Session:
    """A session's folder."""

    folder: Path
    header: SessionHeader

    @classmethod
    def begin(cls, folder: Path, header: SessionHeader) -> Session:
        """Make the folder of a new session.

        Raises:
            DocumentError: the disk refuses.
        """
        try:
            (folder / IMAGES).mkdir(parents=True)
        except OSError as error:
            raise DocumentError(f"cannot be made: {error.strerror}", source=str(folder)) from None
        replace_text(folder / HEADER, header.model_dump_json(indent=1))
        return cls(folder, header)

    @classmethod
    def read(cls, folder: Path) -> Session:
        """Open a session that was begun before.

        Raises:
            DocumentError: there is none, or another version of this program began it.
        """
        text = read_text(folder / HEADER)
        try:
            return cls(folder, SessionHeader.model_validate_json(text))
        except ValueError:
            raise _of_another_version(folder / HEADER, _version(text)) from None

    @property
    def views(self) -> tuple[ViewRecord, ...]:
        """The views, each as it was taken last; a line that was cut short does not count."""
        latest = {view.number: view for view in self._lines()}
        return tuple(latest[number] for number in sorted(latest))

    @property
    def board_views(self) -> tuple[ViewRecord, ...]:
        """The views of boards that can be used."""
        return tuple(view for view in self.views
                     if view.status == "ok" and view.purpose != "sphere")

    def takes(self, number: int) -> int:
        """Count how often a view has been taken."""
        return sum(view.number == number for view in self._lines())

    def _lines(self) -> list[ViewRecord]:
        file = self.folder / VIEWS
        try:
            return [ViewRecord.model_validate_json(line) for line in read_json_lines(file)]
        except ValueError:
            raise _of_another_version(file, self.header.version) from None

    def append(self, view: ViewRecord) -> None:
        """Add a view; on return it is on the disk.

        Raises:
            DocumentError: the disk refuses; what was written before is whole.
        """
        append_line(self.folder / VIEWS, view.model_dump_json())

    def write_image(self, name: str, image: Image) -> str:
        """Keep a picture; on return it is on the disk. Returns its name in the folder."""
        path = self.folder / IMAGES / name
        _, encoded = cv2.imencode(".png", image)
        try:
            with path.open("wb") as stream:
                stream.write(encoded.tobytes())
                stream.flush()
                os.fsync(stream.fileno())
            sync(path.parent)
        except OSError as error:
            raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None
        return f"{IMAGES}/{name}"

    def read_image(self, name: str, image_size: tuple[int, int]) -> Image:
        """Read a picture back."""
        return read_image(self.folder / name, image_size)

    def conclude(self, outcome: str) -> None:
        """Close the session: it cannot be gone on with."""
        replace_text(self.folder / OUTCOME, outcome + "\n")


def latest_session(folder: Path, what: str) -> Path:
    """Find the newest session of a cell that was begun for `what` and not concluded.

    Raises:
        DocumentError: there is none.
    """
    sessions = sorted(path.parent for path in (folder / "sessions").glob(f"*-{what}/{HEADER}")
                      if not (path.parent / OUTCOME).exists())
    if not sessions:
        raise DocumentError(f"there is no open session of `{what}` to go on with",
                            source=str(folder / "sessions"))
    return sessions[-1]


def _of_another_version(file: Path, version: object) -> DocumentError:
    return DocumentError(f"this session was begun by another version of the program (schema "
                         f"{version}, here {SCHEMA}) and cannot be gone on with: begin a new one. "
                         "Its pictures stay where they are; sets made from such sessions stay "
                         "usable", source=str(file))


def _version(text: str) -> object:
    try:
        return json.loads(text).get("version", "unknown")
    except (ValueError, AttributeError):
        return "unknown"
