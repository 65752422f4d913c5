"""What is wrong with a hand-eye session, before anything is solved from it.

A cause is named with its evidence: what it would be like if the session were read otherwise.
Nothing is put right silently. What no residual can show (the board's absolute size, an active TCP,
a focal length that all views share) has to be asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cell.core.geometry import Transform
from cell.metrology.calibration_gates import Ruling
from cell.metrology.diversity import measure_diversity
from cell.metrology.hand_eye import FEWEST_VIEWS, MOST_DROPPED
from cell.metrology.hand_eye_session import HandEyeSession
from cell.metrology.motions import inverse, rotation_vectors, stack
from cell.metrology.readings import Fit, Reading, angle_gap, fit_reading, other_readings

CLEARLY = 0.25          # another reading must leave so much less of the miss
CREDIBLE = 0.01         # of the distance: a reading that leaves more explains nothing
SUSPICIOUS = 0.5        # mm: a smaller miss needs no other reading
UNRELATED = np.radians(2.0)  # turns of robot and camera that differ so much are not one motion
UNIT_TOLERANCE = 0.1
PLAUSIBLE = (20.0, 10_000.0)  # mm between camera and board
STILL_MM, STILL_DEG = 0.02, 0.005
PARALLEL_DEG = 5.0
UNITS = ((1e-3, "robot_unit", "the robot's lengths are in m, not in mm"),
         (1 / 304.8, "robot_unit", "the robot's lengths are in feet, not in mm"),
         (1 / 25.4, "robot_unit", "the robot's lengths are in inch, not in mm"),
         (0.1, "robot_unit", "the robot's lengths are in cm, not in mm"),
         (1e3, "board_unit", "the board's lengths are in m, not in mm"),
         (25.4, "board_unit", "the board's lengths are in inch, not in mm"),
         (10.0, "board_unit", "the board's lengths are in cm, not in mm"))


@dataclass(frozen=True)
class Finding:
    """One cause: a short code, how grave it is, and a sentence with the evidence."""

    code: str
    verdict: Literal["warn", "refuse"]
    sentence: str


def diagnose(session: HandEyeSession) -> list[Finding]:
    """Look for what would make a solution meaningless: the gravest first, nothing if all is well.

    Views during which the robot moved have been left out before: see `moved_views`.
    """
    if len(session) < FEWEST_VIEWS:
        return [Finding("too_few_views", "refuse", f"{len(session)} views: nothing is solved from "
                        f"fewer than {FEWEST_VIEWS}, and 12 are wanted")]
    given = as_given(session)
    fit = fit_reading(given)
    parallel = _parallel(session, given)
    found = parallel or _misread(given, fit) or _other_unit(session, fit) or _unrelated(given, fit)
    return [found] if found else []


def as_given(session: HandEyeSession) -> Reading:
    """Read the session as it claims to be meant."""
    middle = Transform.from_parts(np.zeros(3), session.board_middle)
    boards = stack(board.camera_from_board for board in session.boards) @ middle.matrix
    return Reading("as_given", "as given", session.base_from_flange, boards, session.mount)


def moved_views(session: HandEyeSession) -> dict[int, Finding]:
    """Find the views in which the robot was not standing, by index."""
    if session.after is None:
        return {}
    between = inverse(session.base_from_flange) @ session.after
    shifts = np.linalg.norm(between[:, :3, 3], axis=1)
    turns = np.degrees(np.linalg.norm(rotation_vectors(between), axis=1))
    return {index: Finding("robot_moved", "warn", f"the robot moved by {shift:.3f} mm and "
                           f"{turn:.4f} degrees during view {session.numbers[index]}: it was left "
                           "out")
            for index, (shift, turn) in enumerate(zip(shifts, turns, strict=True))
            if shift > STILL_MM or turn > STILL_DEG}


def contradicting_views(session: HandEyeSession) -> dict[int, Finding]:
    """Find views that contradict all others so grossly that they spoil the closed form, by index.

    At most one in five, and only where leaving them out makes the others agree; a misreading that
    explains everything comes first.
    """
    if len(session) < FEWEST_VIEWS:
        return {}
    given = as_given(session)
    fit = fit_reading(given)
    if fit.miss < CREDIBLE * given.distance or _misread(given, fit):
        return {}
    gone, left = list[int](), fit
    while len(gone) < MOST_DROPPED * len(session) - 1 and left.miss > CLEARLY * fit.miss:
        tried = {index: fit_reading(given.without([*gone, index]))
                 for index in range(len(session)) if index not in gone}
        worst = min(tried, key=lambda index: tried[index].miss)
        gone, left = [*gone, worst], tried[worst]
    if not _explains(left, fit, given.distance):
        return {}
    return {index: Finding("bad_view", "warn", f"view {session.numbers[index]} contradicts all "
                           "others: it was left out, retake it") for index in gone}


def ruled_worst(findings: list[Finding]) -> Ruling:
    """Say whether any finding refuses, or warns."""
    verdicts = {finding.verdict for finding in findings}
    return "refuse" if "refuse" in verdicts else "warn" if verdicts else "pass"


def _misread(given: Reading, fit: Fit) -> Finding | None:
    tried = [(reading, fit_reading(reading)) for reading in other_readings(given)]
    reading, other = min(tried, key=lambda one: one[1].miss)
    if fit.miss < SUSPICIOUS or not _explains(other, fit, given.distance):
        return None
    return Finding(reading.code, "refuse", f"{reading.says}. {_evidence(fit, other)}")


def _explains(other: Fit, fit: Fit, distance: float) -> bool:
    """Whether another reading leaves far less to explain, and little for the distance."""
    return other.miss < CLEARLY * fit.miss and other.miss < CREDIBLE * distance


def _evidence(fit: Fit, other: Fit) -> str:
    as_it_is = (f"the board stands still to {fit.miss:.3g} mm" if np.isfinite(fit.miss)
                else "the board does not stand still at all")
    return f"As given, {as_it_is} (median view); read so, to {other.miss:.3g} mm."


def _other_unit(session: HandEyeSession, fit: Fit) -> Finding | None:
    for factor, code, sentence in UNITS:
        if abs(fit.scale / factor - 1.0) < UNIT_TOLERANCE:
            return Finding(code, "refuse", f"{sentence}: the robot's motions are {fit.scale:.4g} "
                                           "times what the camera saw. Enter lengths in mm.")
    near, far = PLAUSIBLE
    if not near < session.working_distance < far:
        return Finding("length_unit", "refuse", "the board would be "
                       f"{session.working_distance:.3g} mm from the camera: are all lengths in mm?")
    return None


def _unrelated(given: Reading, fit: Fit) -> Finding | None:
    gap = angle_gap(given)
    if gap < UNRELATED and 0.5 < fit.scale < 2.0:
        return None
    return Finding("unrelated", "refuse", "robot and camera do not show one motion, and no known "
                   f"misreading explains it: their turns differ by {np.degrees(gap):.2f} degrees, "
                   f"their shifts by a factor of {fit.scale:.3g}. Do poses and images belong to "
                   "one session, and is the board in every image the same?")


def _parallel(session: HandEyeSession, given: Reading) -> Finding | None:
    """Without two different axes of rotation there is no solution at all."""
    diversity = measure_diversity(given.camera_from_board)
    if np.sort(diversity.principal_deg)[1] > PARALLEL_DEG:
        return None
    return Finding("degenerate_rotations", "refuse", f"the {len(session)} views turn about hardly "
                   f"more than one axis: {diversity.missing or 'turn about a second axis'}")
