"""What can be told of a session while it is captured, against what its solution says in the end."""

import numpy as np
import pytest
from made_sessions import World

from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.camera import solve_camera
from cell.metrology.calibrate.gates import GateBook
from cell.metrology.calibrate.progress import SPARE, GatheredView, check_progress
from cell.programs.calibration.recorded import read_gates


@pytest.fixture(scope="module")
def gates() -> GateBook:
    return read_gates().level("fine")


def gathered(world, session):
    boards = locate_boards(session.views, world.camera)
    return [GatheredView(seen, board) for seen, board in zip(session.views, boards, strict=True)]


def test_it_says_what_the_solution_will_say(gates):
    world = World()
    session = world.session(np.random.default_rng(3), 18)
    checks = {check.name: check for check in check_progress(
        gathered(world, session), world.camera, gates, ("camera", "hand_eye"))}
    result = solve_camera(session.views, world.camera.image_size, world.camera)
    assert checks["views"].value == checks["used_views"].value == 18
    assert checks["used_views"].bound == f">= {12 + SPARE}"
    assert checks["covered_percent"].value == pytest.approx(100.0 * result.covered)
    leans = np.degrees(result.tilts)
    assert checks["tilted_views"].value == np.sum(leans > 20.0)
    assert checks["split_half_percent"].value == pytest.approx(100.0 * result.split_half, rel=1e-3)
    assert checks["covered_percent"].verdict == "warn"  # these views all show the middle


def test_a_plane_is_not_good_enough_before_it_can_be_solved(gates):
    world = World()
    views = gathered(world, world.session(np.random.default_rng(3), 5))
    checks = check_progress(views, world.camera, gates, ("light_plane",))
    assert checks[0].value == 0 and {check.verdict for check in checks} == {"refuse"}
