"""Boards carried to the base: what stands is found to stand, what moved to have moved."""

import numpy as np
import pytest
from made_sessions import BOARD, MOUNTED, SMALL, World

from cell.core.documents.base import as_rows
from cell.core.documents.calibration_session import ViewRecord
from cell.core.geometry import Transform
from cell.metrology.calibrate.board_pose import BoardView
from cell.programs.calibration.chain import Chain
from cell.programs.calibration.seen import SeenView
from cell.programs.calibration.stillness import (
    mean_plane,
    measure_misses,
    measure_scatter,
    measure_shift,
    place_boards,
)

CHAIN, WORLD = Chain(MOUNTED), World(SMALL)
ELSEWHERE = Transform.from_parts([0.4, 2.7, -0.9], [380.0, 410.0, -60.0])


def look(camera_from_board, stands=BOARD, reported=BOARD, place=0):
    """A view of a board at `stands`, from where the camera would see it so if it stood at
    `reported`.
    """
    base_from_flange = as_rows(reported @ camera_from_board.inverse @ MOUNTED.inverse)
    true = camera_from_board @ reported.inverse @ stands
    record = ViewRecord(number=1, purpose="fit", place=place, joints=(0.0,) * 6, time=0.0,
                        base_from_flange=base_from_flange, base_from_flange_after=base_from_flange,
                        ring="", stripe="")
    return SeenView(record, BoardView(WORLD.corners, SMALL.project(true @ WORLD.corners)), None)


@pytest.fixture
def poses():
    return WORLD.board_poses(8, np.random.default_rng(5))


def test_a_board_that_stands_is_placed_where_it_stands(poses):
    views = [look(pose) for pose in poses]
    for found in place_boards(views, SMALL, CHAIN):
        assert found.distance(BOARD) < (1e-5, 1e-7)
    assert mean_plane(views, SMALL, CHAIN).distance(BOARD @ WORLD.corners) == pytest.approx(
        0.0, abs=1e-5)
    assert measure_misses(views, SMALL, CHAIN) == pytest.approx(0.0, abs=1e-5)


def test_the_view_that_the_arm_reports_wrongly_misses_the_mean_board(poses):
    off = Transform.from_parts(np.zeros(3), [0.3, -0.2, 0.1]) @ BOARD
    views = [look(pose, reported=off if pose is poses[2] else BOARD, stands=off if pose is poses[2]
                  else BOARD) for pose in poses]
    misses = measure_misses(views, SMALL, CHAIN)
    length, count = np.linalg.norm([0.3, -0.2, 0.1]), len(poses)
    assert misses[2] == pytest.approx(length * (count - 1) / count, rel=0.01)
    assert np.delete(misses, 2) == pytest.approx(length / count, rel=0.01)


def test_scatter_is_told_within_each_place(poses):
    """Boards in two places stand far apart; each alone stands still, or moves by what it moves."""
    still = [look(pose, where, where, place) for place, where in enumerate((BOARD, ELSEWHERE))
             for pose in poses[4 * place:4 * place + 4]]
    assert measure_scatter(still, SMALL, CHAIN) == pytest.approx(0.0, abs=1e-5)
    steps = [Transform.from_parts(np.zeros(3), [side * 0.05, 0.0, 0.0]) for side in (1, -1, 1, -1)]
    moved = [look(pose, step @ ELSEWHERE, step @ ELSEWHERE, 1)
             for step, pose in zip(steps, poses[4:], strict=True)]
    assert measure_scatter(still[:4] + moved, SMALL, CHAIN) == pytest.approx(
        0.05 / np.sqrt(2.0), rel=0.01)


@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.12, 0.0), (-0.07, 0.21)])
def test_a_board_that_was_pushed_aside_shows_by_how_much(poses, aside):
    pushed = BOARD @ Transform.from_parts(np.zeros(3), [*aside, 0.0])
    upright = Transform.from_parts([np.pi, 0.0, 0.0], [-50.0, 35.0, 250.0])
    shift = measure_shift(look(upright), look(upright, stands=pushed), SMALL, CHAIN)
    assert shift == pytest.approx(np.hypot(*aside), rel=0.02, abs=1e-5)
