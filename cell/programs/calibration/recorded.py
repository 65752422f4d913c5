"""A recorded hand-eye session in a folder: robot poses, corners or board poses, the camera.

| file | content |
|---|---|
| base_from_flange.csv | view, m00..m33: the controller's flange pose, mm |
| views.npz | object_mm (view, corner, 3), image_px (view, corner, 2), padded by NaN |
| camera.yaml | image_size, camera_matrix, distortion [k1, k2, p1, p2, k3] |
| camera_from_board.csv | instead of the two: board poses alone |
| expected.yaml | may hold camera_mount: flange or static |
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from pydantic import ConfigDict

from cell.archive.files import read_text
from cell.core.documents.calibration import CameraDocument
from cell.core.documents.strict_yaml import read_tree
from cell.core.documents.table import Row, read_table
from cell.core.documents.text import parse
from cell.core.errors import DocumentError, UnmeasurableError
from cell.core.geometry import Array
from cell.metrology.calibrate.board_pose import FEWEST_CORNERS, BoardView
from cell.metrology.calibrate.gates import GateBook
from cell.metrology.calibrate.hand_eye.diagnosis import as_given
from cell.metrology.calibrate.hand_eye.readings import fit_reading
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import Mount
from cell.metrology.calibrate.hand_eye.start import solve_park
from cell.metrology.motions import nearest_rotation

ROUNDED = 1e-3  # of R Rᵀ = 1: digits lost in print; beyond it the matrix is no rotation
FLAT = 1e-3     # mm
TOO_FAR = 2.0   # times: an arm carries nothing so much farther out than the rest stands away
COLUMNS = ("view", *(f"m{row}{column}" for row in range(4) for column in range(4)))


class RecordedCamera(CameraDocument):
    """`camera.yaml` of a session; what else stands in it was meant for somebody else."""

    model_config = ConfigDict(extra="ignore")


@dataclass(frozen=True, eq=False)
class Recorded:
    """A session as read, and what had to be assumed or left out to read it."""

    session: HandEyeSession
    notes: tuple[str, ...]


def read_gates() -> GateBook:
    """Read the gates that come with the package."""
    file = resources.files("cell.metrology.calibrate") / "gates.yaml"
    return parse(GateBook, file.read_text("utf-8"), file.name)


def read_recorded(folder: Path, mount: Mount | None = None) -> Recorded:
    """Read a session; where nobody says how the camera is mounted, the data do.

    Raises:
        DocumentError: a file is absent or wrong, or no view carries a board.
    """
    if not folder.is_dir():
        raise DocumentError("there is no such folder", source=str(folder))
    stated = mount or _stated_mount(folder)
    session, notes = _read(folder, stated or "flange")
    if stated:
        return Recorded(session, notes)
    chosen, note = _choose_mount(folder, session)
    return Recorded(chosen, (*notes, note))


def _read(folder: Path, mount: Mount) -> tuple[HandEyeSession, tuple[str, ...]]:
    numbers, robot = _read_poses(folder / "base_from_flange.csv")
    if (folder / "views.npz").exists() or not (folder / "camera_from_board.csv").exists():
        return _read_views(folder, numbers, robot, mount)
    names, boards = _read_poses(folder / "camera_from_board.csv")
    _same_length(folder, robot, boards)
    notes = () if names == numbers else ("the two files name their views differently: row i of the "
                                         "one was taken with row i of the other",)
    return HandEyeSession.of_poses(robot, boards, mount).numbered(numbers), notes


def _read_views(folder: Path, numbers: tuple[int, ...], robot: Array,
                mount: Mount) -> tuple[HandEyeSession, tuple[str, ...]]:
    camera_file = folder / "camera.yaml"
    camera = parse(RecordedCamera, read_text(camera_file), str(camera_file)).camera
    views = _read_corners(folder / "views.npz")
    _same_length(folder, robot, views)
    keep = [index for index, view in enumerate(views) if view.carries_pose]
    notes = tuple(f"view {numbers[index]} has {len(view.pixels)} corners"
                  f"{' on a line' if len(view.pixels) >= FEWEST_CORNERS else ''}: it was left out"
                  for index, view in enumerate(views) if index not in keep)
    if not keep:
        raise DocumentError(f"no view has {FEWEST_CORNERS} corners that are not on one line",
                            source=str(folder))
    try:
        session = HandEyeSession.seen(robot[keep], tuple(views[index] for index in keep), camera,
                                      mount)
    except UnmeasurableError as error:
        raise DocumentError(f"a view carries no board pose: {error.detail}",
                            source=str(folder / "views.npz")) from None
    return session.numbered(tuple(numbers[index] for index in keep)), notes


def _read_poses(file: Path) -> tuple[tuple[int, ...], Array]:
    rows = read_table(read_text(file), str(file), COLUMNS)
    if not rows:
        raise DocumentError("no view", source=str(file))
    poses = np.array([_pose(row) for row in rows])
    named = tuple(int(row.cells["view"]) for row in rows if row.cells["view"].isdecimal())
    return named if len(set(named)) == len(rows) else tuple(range(len(rows))), poses


def _pose(row: Row) -> Array:
    matrix = np.array([row.number(column) for column in COLUMNS[1:]]).reshape(4, 4)
    turn = matrix[:3, :3]
    if not np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], atol=1e-9):
        raise row.refuse("the last row of a pose is 0 0 0 1 (is the matrix written column by "
                         "column?)")
    if np.abs(turn @ turn.T - np.eye(3)).max() > ROUNDED or np.linalg.det(turn) < 0:
        raise row.refuse("the upper left 3x3 of a pose is a rotation: orthogonal unit rows, "
                         "determinant +1")
    matrix[:3, :3] = nearest_rotation(turn)
    matrix[3] = [0.0, 0.0, 0.0, 1.0]
    return matrix


def _read_arrays(file: Path) -> list[Array]:
    try:
        with file.open("rb") as stream, np.lib.npyio.NpzFile(stream) as archive:
            arrays = [archive[name] for name in ("object_mm", "image_px")]
    except FileNotFoundError:
        raise DocumentError("there is no such file", source=str(file)) from None
    except KeyError:
        raise DocumentError("expected arrays object_mm and image_px", source=str(file)) from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DocumentError(f"not a readable .npz of numbers: {error}", source=str(file)) from None
    if any(array.dtype.kind not in "fiu" for array in arrays):
        raise DocumentError("object_mm and image_px: expected real numbers", source=str(file))
    return [array.astype(np.float64) for array in arrays]


def _read_corners(file: Path) -> list[BoardView]:
    points, pixels = _read_arrays(file)
    if points.ndim != 3 or points.shape[2] != 3 or pixels.shape != (*points.shape[:2], 2):
        raise DocumentError("expected object_mm (view, corner, 3) and image_px (view, corner, 2); "
                            f"came {points.shape} and {pixels.shape}", source=str(file))
    seen = np.asarray(np.isfinite(points).all(axis=2) & np.isfinite(pixels).all(axis=2))
    if np.abs(points[seen][:, 2]).max(initial=0.0) > FLAT:
        raise DocumentError("object_mm: expected a flat board with z = 0", source=str(file))
    return [BoardView(point[ok], pixel[ok])
            for point, pixel, ok in zip(points, pixels, seen, strict=True)]


def _stated_mount(folder: Path) -> Mount | None:
    file = folder / "expected.yaml"
    if not file.exists():
        return None
    tree, _ = read_tree(read_text(file), str(file))
    stated = tree.get("camera_mount") if isinstance(tree, dict) else None
    if stated in ("flange", "static") or stated is None:
        return stated
    raise DocumentError(f"camera_mount: expected flange or static; came {stated!r}",
                        source=str(file))


def _choose_mount(folder: Path, session: HandEyeSession) -> tuple[HandEyeSession, str]:
    """Let the data say how the camera is mounted: the mount under which the board stands still.

    Poses given the other way round fit the other mount as well; what tells is that no arm carries
    what is farther from its flange than the rest is from its base.
    """
    mounts: tuple[Mount, Mount] = ("flange", "static")
    fits = {mount: fit_reading(as_given(session.mounted(mount))) for mount in mounts}
    best, other = sorted(mounts, key=lambda mount: fits[mount].miss)
    carried, standing = _reach(session.mounted(best), fits[best].scale)
    chosen = other if carried > TOO_FAR * standing else best
    doubt = ("" if chosen == best else f", but then the arm would carry something {carried:.0f} mm "
             f"from its flange, and the rest stand {standing:.0f} mm from its base")
    return session.mounted(chosen), (
        f"nothing in {folder.name} says how the camera is mounted: taken as {chosen}. As {best}, "
        f"the board stands still to {fits[best].miss:.3g} mm{doubt}; as {other}, to "
        f"{fits[other].miss:.3g} mm. Say --mount if it is known")


def _reach(session: HandEyeSession, scale: float) -> tuple[float, float]:
    """Say how far from the flange is what the arm carries, and from the base what stands, in the
    unit of the board; the robot's is `scale` times that.
    """
    given = as_given(session)
    moving, boards = given.reference_from_carrier.copy(), given.camera_from_board
    moving[:, :3, 3] /= scale
    camera = solve_park(moving, boards)
    to_board = float(np.median(np.linalg.norm((moving @ camera.matrix @ boards)[:, :3, 3], axis=1)))
    to_camera = float(np.linalg.norm(camera.translation))
    return (to_camera, to_board) if session.mount == "flange" else (to_board, to_camera)


def _same_length(folder: Path, robot: Array, others: Array | list[BoardView]) -> None:
    if len(robot) != len(others):
        raise DocumentError(f"{len(robot)} robot poses but {len(others)} views: row i of the one "
                            "belongs to row i of the other", source=str(folder))
