"""What is wrong with a hand-eye session, before anything is solved from it.

A cause is named with its evidence: what it would be like if the session were read otherwise.
Nothing is put right silently. What no residual can show (the board's absolute size, an active TCP,
a focal length that all views share) has to be asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Transform
from cell.metrology.calibrate.hand_eye.diversity import measure_diversity
from cell.metrology.calibrate.hand_eye.finding import Finding, ruled_worst
from cell.metrology.calibrate.hand_eye.readings import (
    Fit,
    Reading,
    angle_gap,
    fit_reading,
    other_readings,
)
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import FEWEST_VIEWS, MOST_DROPPED
from cell.metrology.calibrate.hand_eye.suspect_views import suspect_views
from cell.metrology.motions import stack

CLEARLY = 0.25          # another reading must leave so much less of the miss
CREDIBLE = 0.01         # of the distance: a reading that leaves more explains nothing
SUSPICIOUS = 0.5        # mm: a smaller miss needs no other reading
UNRELATED = np.radians(2.0)  # turns of robot and camera that differ so much are not one motion
UNIT_TOLERANCE = 0.1
PLAUSIBLE = (20.0, 10_000.0)  # mm between camera and board
PARALLEL_DEG = 5.0
UNITS = ((1e-3, "robot_unit", "the robot's lengths are in m, not in mm"),
         (1 / 304.8, "robot_unit", "the robot's lengths are in feet, not in mm"),
         (1 / 25.4, "robot_unit", "the robot's lengths are in inch, not in mm"),
         (0.1, "robot_unit", "the robot's lengths are in cm, not in mm"),
         (1e3, "board_unit", "the board's lengths are in m, not in mm"),
         (25.4, "board_unit", "the board's lengths are in inch, not in mm"),
         (10.0, "board_unit", "the board's lengths are in cm, not in mm"))


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found, the gravest first; `sound` is the session without the views left out."""

    findings: tuple[Finding, ...]
    sound: HandEyeSession

    @property
    def solvable(self) -> bool:
        """Whether a solution would mean anything."""
        return ruled_worst(self.findings) != "refuse"


def diagnose(session: HandEyeSession) -> Diagnosis:
    """Look for what would make a solution meaningless, and leave out views that carry nothing."""
    left_out = suspect_views(session)
    sound, about = session.without(left_out), tuple(left_out.values())
    found = _too_few(sound) or _other_camera(sound) or _parallel(sound) or _misread(sound)
    if found is None:
        gross = _contradicting(sound)
        sound, about = sound.without(gross), (*gross.values(), *about)
        found = _too_few(sound) or _parallel(sound) or _unrelated(sound) or _other_unit(sound)
    return Diagnosis((found, *about) if found else about, sound)


def as_given(session: HandEyeSession) -> Reading:
    """Read the session as it claims to be meant."""
    middle = Transform.from_parts(np.zeros(3), session.board_middle)
    boards = stack(board.camera_from_board for board in session.boards) @ middle.matrix
    return Reading("as_given", "as given", session.base_from_flange, boards, session.mount,
                   session.numbers)


def _contradicting(session: HandEyeSession) -> dict[int, Finding]:
    """Find views that contradict all others so grossly that they spoil the closed form, by index.

    At most one in five, and only where leaving them out makes the others agree.
    """
    given = as_given(session)
    fit = fit_reading(given)
    if fit.miss < CREDIBLE * given.distance:
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


def _too_few(session: HandEyeSession) -> Finding | None:
    if len(session) >= FEWEST_VIEWS:
        return None
    return Finding("too_few_views", "refuse", f"{len(session)} views: nothing is solved "
                   f"from fewer than {FEWEST_VIEWS}, and 12 are wanted")


def _other_camera(session: HandEyeSession) -> Finding | None:
    """Corners beside the picture can only have been seen by a camera with another one."""
    if session.camera is None:
        return None
    pixels = np.concatenate([view.pixels for view in session.views])
    width, height = session.camera.image_size
    if (pixels > -1.0).all() and (pixels < (width, height)).all():
        return None
    return Finding("intrinsics", "refuse", "the intrinsics are those of another camera: corners "
                   f"lie beside a picture of {width} x {height} px, as far as "
                   f"({pixels[:, 0].max():.0f}, {pixels[:, 1].max():.0f})")


def _misread(session: HandEyeSession) -> Finding | None:
    given = as_given(session)
    fit = fit_reading(given)
    if fit.miss < SUSPICIOUS:
        return None
    tried = [(reading, fit_reading(reading)) for reading in other_readings(given)]
    reading, other = min(tried, key=lambda one: one[1].miss)
    if not _explains(other, fit, given.distance):
        return None
    return Finding(reading.code, "refuse", f"{reading.says}. {_evidence(fit, other)}")


def _explains(other: Fit, fit: Fit, distance: float) -> bool:
    """Whether another reading leaves far less to explain, and little for the distance."""
    return other.miss < CLEARLY * fit.miss and other.miss < CREDIBLE * distance


def _evidence(fit: Fit, other: Fit) -> str:
    as_it_is = (f"the board stands still to {fit.miss:.3g} mm" if np.isfinite(fit.miss)
                else "the board does not stand still at all")
    return f"As given, {as_it_is} (median view); read so, to {other.miss:.3g} mm."


def _other_unit(session: HandEyeSession) -> Finding | None:
    scale = fit_reading(as_given(session)).scale
    for factor, code, sentence in UNITS:
        if abs(scale / factor - 1.0) < UNIT_TOLERANCE:
            return Finding(code, "refuse", f"{sentence}: the robot's motions are {scale:.4g} "
                                           "times what the camera saw. Enter lengths in mm.")
    near, far = PLAUSIBLE
    if not near < session.working_distance < far:
        return Finding("length_unit", "refuse", "the board would be "
                       f"{session.working_distance:.3g} mm from the camera: are all lengths in mm?")
    if 0.5 < scale < 2.0:
        return None
    return Finding("unrelated", "refuse", "robot and camera do not show one motion: their shifts "
                   f"differ by a factor of {scale:.3g}, which is no unit of length")


def _unrelated(session: HandEyeSession) -> Finding | None:
    """Turns know no unit: where they differ, or a shift runs backwards, no unit explains it."""
    given = as_given(session)
    gap, scale = angle_gap(given), fit_reading(given).scale
    if gap < UNRELATED and scale > 0.0:
        return None
    return Finding("unrelated", "refuse", "robot and camera do not show one motion, and no known "
                   f"misreading explains it: their turns differ by {np.degrees(gap):.2f} degrees "
                   "(median pair). Do poses and images belong to one session, is the board in "
                   "every image the same, and are angles degrees or radians as they should be?")


def _parallel(session: HandEyeSession) -> Finding | None:
    """Without two different axes of rotation there is no solution at all."""
    diversity = measure_diversity(as_given(session).camera_from_board)
    first, second = np.sort(diversity.principal_deg)[:0:-1]
    if second > PARALLEL_DEG:
        return None
    turn = "hardly turn at all" if first < PARALLEL_DEG else "turn about hardly more than one axis"
    return Finding("degenerate_rotations", "refuse", f"the {len(session)} views {turn}: "
                   f"{diversity.missing or 'turn about a second axis'}")
