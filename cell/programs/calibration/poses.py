"""Where to look at the board from: for the least uncertainty, and with every move free."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cell.core.documents.calibration_session import CalibrationPlan, Purpose
from cell.core.documents.targets import SphereDocument
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.core.ports import Joints
from cell.metrology.calibrate.detect_board import BoardDesign
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeView
from cell.metrology.calibrate.pose_planning import plan_views, predict_point_sigma
from cell.metrology.calibrate.sphere_views import draw_sphere_views
from cell.metrology.calibrate.view_candidates import Spread, draw_candidates, predict_board
from cell.metrology.plan.way import Leg, check_leg
from cell.programs.calibration.belief import Belief

CANDIDATES = 140
SPHERE_CANDIDATES = 60
START_CANDIDATES, ROLL = 16, 90.0  # degrees, each way
CORNER_SIGMA = 0.05  # px, of a board in focus


@dataclass(frozen=True, eq=False)
class PlannedViews:
    """The views in the order of capture, and what they are predicted to be worth (mm)."""

    targets: tuple[tuple[Purpose, Joints], ...]
    predicted: float


def plan_start(belief: Belief, design: BoardDesign, base_from_board: Transform) -> Joints:
    """Find joints from which the camera looks straight at the board, rolled only where it must be.

    Raises:
        DocumentError: not reachable, or the way from home is not free.
    """
    home, problems = belief.home, ["out of reach"]
    for joints in _starts(belief, design, base_from_board):
        found = _problems(belief, home, joints)
        if not found:
            return joints
        problems.append(found[0])
    raise DocumentError(f"the board cannot be looked at: {problems[min(1, len(problems) - 1)]}",
                        source=str(belief.folder / "targets.yaml"))


def _starts(belief: Belief, design: BoardDesign, base_from_board: Transform) -> Iterator[Joints]:
    """Straight views of a board, near home first, then near the middle of the joints' ranges."""
    middle = tuple(np.radians(np.mean(belief.station.limits.joints_deg, axis=1)))
    for roll, count in ((0.1, 1), (ROLL, START_CANDIDATES)):
        for pose in draw_candidates(count, design, belief.sensor.camera,
                                    belief.sensor.working_distance, Spread(0.1, roll, 0.1, 0.0)):
            for seed in (belief.home, middle):
                if (joints := _joints(belief, base_from_board, pose, seed)) is not None:
                    yield joints


def plan_poses(belief: Belief, plan: CalibrationPlan, design: BoardDesign,
               base_from_board: Transform, start: Joints) -> PlannedViews:
    """Choose the views to fit and to hold out, every move between them free.

    Raises:
        DocumentError: too few views can be reached safely.
    """
    camera, distance = belief.sensor.camera, belief.sensor.working_distance
    drawn = draw_candidates(CANDIDATES, design, camera, distance,
                            Spread(plan.lean_deg, plan.roll_deg, plan.depth_mm, plan.aside_mm))
    pairs = [(pose, _joints(belief, base_from_board, pose, start)) for pose in drawn]
    reached = [(pose, joints) for pose, joints in pairs
               if joints and not _problems(belief, start, joints)]
    wanted = plan.views + plan.hold_out
    if len(reached) < wanted:
        raise DocumentError(f"{len(reached)} of {len(drawn)} views can be reached safely; {wanted} "
                            "are wanted: move the board, or lean and roll less",
                            source=str(belief.folder / "targets.yaml"))
    problem = _believed(belief, design, base_from_board, [pose for pose, _ in reached])
    order = plan_views(problem, belief.flange_from_camera, base_from_board, distance, plan.views)
    rest = [index for index in range(len(reached)) if index not in order]
    apart = [rest[index] for index in np.linspace(0, len(rest) - 1, plan.hold_out).astype(int)]
    predicted = predict_point_sigma(problem.take(order), belief.flange_from_camera,
                                    base_from_board, distance)
    targets: list[tuple[Purpose, Joints]] = [("fit", _of(reached, index)) for index in order]
    targets += [("hold_out", _of(reached, index)) for index in apart]
    return PlannedViews(tuple(targets), predicted)


def plan_sphere(belief: Belief, sphere: SphereDocument, start: Joints,
                count: int) -> tuple[Joints, ...]:
    """Choose joints that look at a sphere, every move to and from the start view free.

    Raises:
        DocumentError: too few are.
    """
    drawn = draw_sphere_views(SPHERE_CANDIDATES, belief.sensor, np.array(sphere.centre),
                              sphere.radius_mm)
    poses = [pose @ belief.flange_from_camera.inverse for pose in drawn]
    found = [belief.arm.closest(pose, start) for pose in poses]
    free = [joints for joints in found if joints and not _problems(belief, start, joints)]
    if len(free) < count:
        raise DocumentError(f"the sphere {sphere.id} can be looked at from {len(free)} sides; "
                            f"{count} are wanted: move it, or plan fewer `sphere_views`",
                            source=str(belief.folder / "targets.yaml"))
    return tuple(free[:count])


def free_path(belief: Belief, here: Joints, there: Joints, *safe: Joints) -> list[Joints]:
    """Choose the moves to a view: straight, or by the last of the safe places, or the last two ...

    Raises:
        DocumentError: none of these ways is free.
    """
    for count in range(len(safe) + 1):
        path = [*safe[len(safe) - count:], there]
        legs = zip([here, *path[:-1]], path, strict=True)
        if not any(_problems(belief, *leg) for leg in legs):
            return path
    raise DocumentError("the way to the next view is not free from where the arm stands: jog it to "
                        "the start view", source=f"cell {belief.station.name}")


def _of(reached: Sequence[tuple[Transform, Joints | None]], index: int) -> Joints:
    joints = reached[index][1]
    assert joints is not None
    return joints


def _joints(belief: Belief, base_from_board: Transform, camera_from_board: Transform,
            near: Joints) -> Joints | None:
    wanted = base_from_board @ camera_from_board.inverse @ belief.flange_from_camera.inverse
    return belief.arm.closest(wanted, near)


def _problems(belief: Belief, here: Joints, there: Joints) -> tuple[str, ...]:
    return check_leg(Leg("here", "the view", (here, there)), belief.station.limits,
                     belief.arm).problems


def _believed(belief: Belief, design: BoardDesign, base_from_board: Transform,
              poses: Sequence[Transform]) -> HandEyeProblem:
    back = belief.flange_from_camera.inverse
    return HandEyeProblem(tuple(
        HandEyeView(base_from_board @ pose.inverse @ back,
                    predict_board(pose, design, belief.sensor.camera, CORNER_SIGMA))
        for pose in poses))
