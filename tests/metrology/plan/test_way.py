import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cell.core.documents.station import Box, Limits
from cell.core.kinematics import arm_for
from cell.metrology.plan.way import CLEARANCE, Leg, check_leg

ARM = arm_for("ur10e")
HOME = np.radians([138.0, -110.0, 123.0, 1.5, 47.0, 158.0])
HULL = ((-90.0, -28.0, -7.0), (-94.0, -32.0, 98.0), (-108.0, 60.0, -5.0), (-113.0, 56.0, 100.0),
        (116.0, 15.0, 4.0), (111.0, 12.0, 108.0), (97.0, 103.0, 6.0), (92.0, 100.0, 110.0))
EVERYWHERE = Box(name="everywhere", min=(-3000.0,) * 3, max=(3000.0,) * 3)


def limits(*keep_out, hull=HULL, workspace=EVERYWHERE, margin=0.0):
    return Limits(joints_deg=((-360.0, 360.0),) * 6, workspace=workspace, keep_out=keep_out,
                  sensor_points=hull, singularity_margin_deg=margin)


def box_about(point, half):
    return Box(name="box", min=tuple(np.subtract(point, half)), max=tuple(np.add(point, half)))


turns = st.tuples(*[st.floats(-0.6, 0.6)] * 6)


@given(turns, turns, st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_nothing_that_the_sensor_sweeps_is_missed(start, end, seed):
    """A box round any point of the hull at any moment of the move is met, however small it is."""
    rng = np.random.default_rng(seed)
    leg = Leg("a", "b", (tuple(HOME + start), tuple(HOME + end)))
    moment = HOME + start + rng.uniform() * np.subtract(end, start)
    inside = np.array(HULL).T @ rng.dirichlet(np.full(8, 0.5))
    touched = ARM.forward(moment) @ inside
    passage = check_leg(leg, limits(box_about(touched, 0.5)), ARM)
    assert "keep-out box 'box'" in " ".join(passage.problems)
    assert passage.clearance < CLEARANCE


@given(turns, turns, st.floats(60.0, 400.0))
@settings(max_examples=40)
def test_the_clearance_is_the_distance_that_is_left(start, end, distance):
    """A floor that far below the lowest of all points is that far away."""
    leg = Leg("a", "b", (tuple(HOME + start), tuple(HOME + end)))
    flanges = ARM.flanges(np.linspace(*leg.joints, 400))
    lowest = float((flanges[:, 2, :3] @ np.array(HULL).T + flanges[:, 2, 3:]).min())
    floor = Box(name="floor", min=(-5000.0, -5000.0, lowest - distance - 10.0),
                max=(5000.0, 5000.0, lowest - distance))
    passage = check_leg(leg, limits(floor), ARM)
    assert passage.obstacle == "floor"
    assert passage.clearance == pytest.approx(distance, abs=0.5)


def test_the_nearest_of_many_boxes_is_named():
    leg = Leg("a", "b", (tuple(HOME), tuple(HOME)))
    top = (ARM.forward(HOME) @ np.array(HULL)).max(axis=0)
    boxes = [Box(name=f"shelf {gap}", min=tuple(np.add(top, [0, 0, gap])),
                 max=tuple(np.add(top, [500, 500, gap + 1]))) for gap in (500.0, 90.0, 260.0)]
    passage = check_leg(leg, limits(*boxes), ARM)
    assert passage.obstacle == "shelf 90.0"
    assert passage.problems == ()


@pytest.mark.parametrize("hull", [(), HULL[:1], HULL[:2], HULL[:3],
                                  tuple((x, y, 0.0) for x, y, _ in HULL)])
def test_a_flat_or_missing_hull_is_still_checked(hull):
    point = ARM.forward(HOME) @ np.array(hull[0] if hull else (0.0, 0.0, 0.0))
    leg = Leg("a", "b", (tuple(HOME), tuple(HOME + 0.01)))
    assert check_leg(leg, limits(box_about(point, 2.0), hull=hull), ARM).problems
    assert not check_leg(leg, limits(hull=hull), ARM).problems


def test_the_workspace_holds_the_whole_sensor():
    leg = Leg("a", "b", (tuple(HOME), tuple(HOME)))
    points = ARM.forward(HOME) @ np.array(HULL)
    low, high = points.min(axis=0), points.max(axis=0)
    fits = Box(name="w", min=tuple(low - 1.0), max=tuple(high + 1.0))
    assert check_leg(leg, limits(workspace=fits), ARM).problems == ()
    for axis in range(3):
        tight = high + 1.0
        tight[axis] -= 3.0
        small = Box(name="w", min=tuple(low - 1.0), max=tuple(tight))
        problem, = check_leg(leg, limits(workspace=small), ARM).problems
        assert f"leaves the workspace: {'xyz'[axis]}" in problem


def test_a_move_through_a_singularity_is_found_in_its_middle():
    through = HOME.copy()
    through[4] = -through[4]
    leg = Leg("a", "b", (tuple(HOME), tuple(through)))
    passage = check_leg(leg, limits(margin=5.0), ARM)
    assert passage.singularity_deg < 0.5
    assert "singularity" in passage.problems[0]
