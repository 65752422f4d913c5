"""Hand-eye as a whole: diagnose, solve, hold out, judge. One session in, one answer out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from cell.metrology.calibrate.gates import Checked, GateSet, check_gates, worst
from cell.metrology.calibrate.hand_eye.check import HeldOut, solve_and_hold_out, solve_apart
from cell.metrology.calibrate.hand_eye.diagnosis import CLEARLY, diagnose
from cell.metrology.calibrate.hand_eye.diagnosis_fit import (
    check_camera,
    judge_board,
    judge_camera,
    judge_scale,
    judge_views,
)
from cell.metrology.calibrate.hand_eye.explanations import estimate_board_scale
from cell.metrology.calibrate.hand_eye.figures import fit_figures, input_figures, what_limits
from cell.metrology.calibrate.hand_eye.finding import Finding
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, Mount, solve_hand_eye

Answer: TypeAlias = Literal["pass", "refuse", "solved"]

FIRST = ("intrinsics", "preview")
ENOUGH_VIEWS = 12  # below it a solution is a preview that cannot be activated


@dataclass(frozen=True, eq=False)
class HandEyeAnswer:
    """The verdict on a session. `held_out` is None where nothing could be solved.

    `numbers` are the session's numbers of the views that were kept, in the order of the problem
    that `held_out` speaks of; `apart` and `left_out` are numbers too. `figures` are what the gates
    looked at; `limited_by` says what limits the result.
    """

    verdict: Answer
    mount: Mount
    findings: tuple[Finding, ...]
    gates: tuple[Checked, ...] = ()
    held_out: HeldOut | None = None
    figures: Mapping[str, float] = field(default_factory=dict)
    kept: HandEyeProblem | None = None
    numbers: tuple[int, ...] = ()
    left_out: tuple[int, ...] = ()
    limited_by: str = ""

    @property
    def reasons(self) -> tuple[str, ...]:
        """What was found: causes before figures, what refuses before what warns."""
        causes = [(finding.verdict, finding.sentence) for finding in self.findings]
        figures = [(gate.verdict, str(gate)) for gate in self.gates]
        return tuple(sentence for said in (causes, figures) for wanted in ("refuse", "warn")
                     for verdict, sentence in said if verdict == wanted)

    @property
    def used(self) -> tuple[int, ...]:
        """The views that were fitted."""
        unused = {*self.apart, *self.left_out}
        return tuple(number for number in self.numbers if number not in unused)

    @property
    def unknown(self) -> str:
        """The name of what is solved, which the mount decides."""
        return "flange_from_camera" if self.mount == "flange" else "base_from_camera"

    @property
    def board(self) -> str:
        """The name of the board's pose, which comes out as well."""
        return "base_from_board" if self.mount == "flange" else "flange_from_board"

    @property
    def apart(self) -> tuple[int, ...]:
        """The views that were kept out of the fit."""
        return () if self.held_out is None else tuple(self.numbers[i] for i in self.held_out.apart)


def calibrate_hand_eye(session: HandEyeSession, gates: GateSet,
                       apart: Collection[int] = ()) -> HandEyeAnswer:
    """Diagnose a session, solve it where that has a meaning, and judge the solution by the gates.

    Board poses without corners are solved and not judged: nothing says what they are worth. The
    views numbered `apart` are never fitted; without any, some are chosen.
    """
    diagnosis = diagnose(session)
    sound = diagnosis.sound
    left_out = tuple(sorted(set(session.numbers) - set(sound.numbers)))
    if not diagnosis.solvable:
        findings = (*_spoilt_camera(sound, diagnosis.findings, gates), *diagnosis.findings)
        return HandEyeAnswer("refuse", session.mount, findings, left_out=left_out)
    problem = sound.problem(gates.robot.noise)
    whole = solve_hand_eye(problem)
    kept = sound.without(whole.dropped)
    about = (*judge_board(sound, problem, whole), *judge_views(sound, problem, whole),
             *diagnosis.findings)
    answer = _judged(session, kept, gates, apart) if session.views else _solved(kept, gates)
    return _with(answer, about, left_out + _numbers(sound, whole.dropped))


def _spoilt_camera(session: HandEyeSession, findings: Iterable[Finding],
                   gates: GateSet) -> list[Finding]:
    """Look at the camera where nothing else explains why robot and camera show no one motion."""
    if "unrelated" not in {finding.code for finding in findings}:
        return []
    limit = gates.hand_eye["pnp_rms_px"].refuse_above or np.inf
    camera = check_camera(session, session)
    if camera is not None and camera.object_rms_own < CLEARLY * camera.object_rms_given:
        return judge_camera(camera, gates.hand_eye["split_half_percent"])
    if session.pnp_rms_px < limit:
        return []
    return [Finding("corners", "refuse", "the corners are of no flat board before any camera: they "
                    f"miss it by {session.pnp_rms_px:.3g} px. Are they numbered alike in object "
                    "and image, and are pixels given as (x, y)?")]


def _solved(session: HandEyeSession, gates: GateSet) -> HandEyeAnswer:
    problem = _as_scattered(session.problem(gates.robot.noise))
    held_out, whole = solve_and_hold_out(problem), solve_hand_eye(problem)
    found = [*judge_scale(estimate_board_scale(problem, whole), whole.chi2,
                          gates.hand_eye["board_scale_percent"]), *_preview(session)]
    return HandEyeAnswer("solved", session.mount,
                         tuple(replace(finding, verdict="warn") for finding in found), (),
                         held_out, fit_figures(session, problem, held_out), problem,
                         session.numbers)


def _as_scattered(problem: HandEyeProblem) -> HandEyeProblem:
    """Let the misfit say what board poses are worth that came without their corners."""
    chi2 = solve_hand_eye(problem).chi2
    return replace(problem, views=tuple(
        replace(view, board=replace(view.board, covariance=chi2 * view.board.covariance))
        for view in problem.views))


def _judged(session: HandEyeSession, sound: HandEyeSession, gates: GateSet,
            apart: Collection[int]) -> HandEyeAnswer:
    problem = sound.problem(gates.robot.noise)
    kept_apart = [index for index, number in enumerate(sound.numbers) if number in apart]
    held_out = solve_apart(problem, kept_apart) if kept_apart else solve_and_hold_out(problem)
    whole = solve_hand_eye(problem)
    scale = estimate_board_scale(problem, whole)
    camera = check_camera(session, sound)
    figures = {**input_figures(sound, camera, scale), **fit_figures(sound, problem, held_out)}
    limits = gates.hand_eye
    found = [*judge_camera(camera, limits["split_half_percent"]), *_preview(sound),
             *judge_scale(scale, whole.chi2, limits["board_scale_percent"])]
    return HandEyeAnswer("pass", session.mount, tuple(found), check_gates(figures, limits),
                         held_out, figures, problem, sound.numbers,
                         limited_by=what_limits(figures, camera, limits))


def _with(answer: HandEyeAnswer, about: tuple[Finding, ...],
          left_out: tuple[int, ...]) -> HandEyeAnswer:
    """Add what was found of the views, and draw the verdict from everything together.

    The camera comes first, since it spoils everything else; then the views; the board's size last,
    since it may be mimicked by any of them.
    """
    first = tuple(finding for finding in answer.findings if finding.code in FIRST)
    last = tuple(finding for finding in answer.findings if finding.code not in FIRST)
    findings = (*first, *about, *last)
    ruling = worst([*(finding.verdict for finding in findings),
                    *(gate.verdict for gate in answer.gates)])
    verdict = "refuse" if ruling == "refuse" else answer.verdict
    return replace(answer, verdict=verdict, findings=findings, left_out=left_out)


def _preview(session: HandEyeSession) -> list[Finding]:
    if len(session) >= ENOUGH_VIEWS:
        return []
    return [Finding("preview", "refuse", f"{len(session)} views: a preview, which cannot be "
                    f"activated; {ENOUGH_VIEWS} are wanted")]


def _numbers(session: HandEyeSession, indices: Iterable[int]) -> tuple[int, ...]:
    return tuple(session.numbers[index] for index in indices)
