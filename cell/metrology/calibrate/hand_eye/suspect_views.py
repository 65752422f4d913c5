"""Views that show by themselves that they carry nothing: the arm moved, the picture is poor, or
pose or picture is that of another view.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from cell.core.geometry import Array
from cell.metrology.calibrate.hand_eye.finding import Finding
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.motions import inverse, rotation_vectors

STILL_MM, STILL_DEG = 0.02, 0.005
SAME_MM, SAME_DEG, SAME_PX = 1e-3, 1e-4, 1e-6  # no robot comes back so well, no camera sees so well
ELSEWHERE = 0.01     # of the distance, by which a board stands elsewhere
POOR = 3.0           # times the median view's misfit of the corners
POOR_FROM_PX = 0.1


def suspect_views(session: HandEyeSession) -> dict[int, Finding]:
    """Find the views to leave out, by index, each with the reason."""
    return {**_poor_pictures(session), **_repeated(session), **_moved(session)}


def _moved(session: HandEyeSession) -> dict[int, Finding]:
    if session.after is None:
        return {}
    shifts, turns = _apart(session.base_from_flange, session.after)
    return {index: Finding("robot_moved", "warn", f"the robot moved by {shift:.3f} mm and "
                           f"{turn:.4f} degrees during view {session.numbers[index]}: it was left "
                           "out")
            for index, (shift, turn) in enumerate(zip(shifts, turns, strict=True))
            if shift > STILL_MM or turn > STILL_DEG}


def _poor_pictures(session: HandEyeSession) -> dict[int, Finding]:
    if not session.views:
        return {}
    misfits = [board.rms_px for board in session.boards]
    usual = float(np.median(misfits))
    return {index: Finding("poor_picture", "warn", f"the corners of view {session.numbers[index]} "
                           f"miss a flat board by {misfit:.2f} px, those of the median view by "
                           f"{usual:.2f}: blurred, or the arm moved; it was left out, retake it")
            for index, misfit in enumerate(misfits) if misfit > max(POOR * usual, POOR_FROM_PX)}


def _repeated(session: HandEyeSession) -> dict[int, Finding]:
    """Find the later one of two views that share their pose, their picture, or both."""
    found: dict[int, Finding] = {}
    for first, second in combinations(range(len(session)), 2):
        pose, picture = _same_pose(session, first, second), _same_picture(session, first, second)
        names = session.numbers[first], session.numbers[second]
        if pose and picture:
            found[second] = Finding("duplicate_view", "warn", f"view {names[1]} is view {names[0]} "
                                    "once more: it counts once")
        elif picture or (pose and _elsewhere(session, first, second)):
            shared, other = ("robot pose", "picture") if pose else ("picture", "robot pose")
            found[second] = Finding("stale_view", "warn", f"views {names[0]} and {names[1]} have "
                                    f"the same {shared} but not the same {other}: one of the two "
                                    f"is an old one; view {names[1]} was left out, retake it")
    return found


def _same_pose(session: HandEyeSession, first: int, second: int) -> bool:
    poses = session.base_from_flange
    shifts, turns = _apart(poses[[first]], poses[[second]])
    return bool(shifts[0] < SAME_MM and turns[0] < SAME_DEG)


def _same_picture(session: HandEyeSession, first: int, second: int) -> bool:
    if not session.views:
        boards = [session.boards[index].camera_from_board.matrix for index in (first, second)]
        return bool(np.abs(boards[0] - boards[1]).max() < SAME_PX)
    one, other = (session.views[index].pixels for index in (first, second))
    return one.shape == other.shape and bool(np.abs(one - other).max() < SAME_PX)


def _elsewhere(session: HandEyeSession, first: int, second: int) -> bool:
    one, other = (session.boards[index].camera_from_board @ session.board_middle
                  for index in (first, second))
    return float(np.linalg.norm(one - other)) > ELSEWHERE * session.working_distance


def _apart(poses: Array, others: Array) -> tuple[Array, Array]:
    """Measure shifts (mm) and turns (degrees) between stacks (n, 4, 4)."""
    between = inverse(poses) @ others
    return (np.linalg.norm(between[:, :3, 3], axis=1),
            np.degrees(np.linalg.norm(rotation_vectors(between), axis=1)))
