import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from cell.core.documents.base import Document
from cell.core.documents.job import Stop, Via
from cell.core.documents.station import Box
from cell.core.errors import DocumentError
from cell.core.geometry import Transform
from cell.core.kinematics import arm_for
from cell.metrology.plan.stop_pose import choose_aim, compute_pose, find_sight_problem, step_back
from cell.metrology.plan.stops import draw_plan, plan_stops, walk
from cell.metrology.plan.way import Leg, check_leg

ARM = arm_for("ur10e")


@pytest.fixture
def papers(workplace):
    return workplace.papers()


def changed(papers, **fields):
    """Papers with other fields of `job`, `station` or `station.limits`."""
    def updated(document: Document, names):
        return document.model_copy(update={name: fields[name] for name in names if name in fields})

    limits = updated(papers.station.limits, type(papers.station.limits).model_fields)
    station = updated(papers.station, type(papers.station).model_fields)
    return dataclasses.replace(papers, job=updated(papers.job, type(papers.job).model_fields),
                               station=station.model_copy(update={"limits": limits}))


def planned(papers):
    return plan_stops(papers.job, papers.holes, papers.calibration, papers.station, ARM)


def refusal(papers):
    with pytest.raises(DocumentError) as refused:
        planned(papers)
    return str(refused.value)


def test_the_demo_is_planned_in_its_order(papers):
    stops = planned(papers)
    assert [stop.hole.id for stop in stops] == [stop.hole for stop in papers.job.stops]
    assert sum(stop.taught for stop in stops) == 3
    assert [len(stop.via) for stop in stops if stop.via] == [1]


def test_every_stop_sees_its_hole_where_optic_axis_and_light_plane_meet(papers):
    sensor = papers.calibration.sensor.model
    for stop in planned(papers):
        camera_from_body = papers.calibration.body_from_camera(stop.base_from_flange).inverse
        centre = camera_from_body @ stop.hole.centre_on_seen_face
        if not stop.taught:
            np.testing.assert_allclose(centre, [0, 0, sensor.working_distance], atol=1e-5)
            normal = camera_from_body.turn(stop.hole.normal_to_camera)
            np.testing.assert_allclose(normal, [0, 0, -1], atol=1e-8)
        reached = ARM.forward(stop.joints)
        assert reached.distance(stop.base_from_flange)[0] < 1e-6


def test_every_stop_is_entered_along_the_optic_axis(papers):
    for stop in planned(papers):
        ahead = (papers.calibration.flange_from_camera.inverse
                 @ stop.base_from_flange.inverse @ ARM.forward(stop.approach)
                 @ papers.calibration.flange_from_camera)
        np.testing.assert_allclose(ahead.matrix[:3, 3], [0, 0, -papers.station.approach_mm],
                                   atol=1e-6)
        np.testing.assert_allclose(ahead.rotation, np.eye(3), atol=1e-8)


def test_roll_turns_about_the_hole_and_tilt_leans_over_it(papers):
    hole, calibration = papers.holes[0], papers.calibration
    upright, rolled, leaning = (
        calibration.body_from_camera(compute_pose(stop, hole, calibration)) for stop in
        (Stop(hole="A"), Stop(hole="A", roll_deg=30.0), Stop(hole="A", tilt_deg=10.0)))
    assert np.degrees(upright.distance(rolled)[1]) == pytest.approx(30.0)
    assert np.degrees(upright.distance(leaning)[1]) == pytest.approx(10.0)
    distance = calibration.sensor.model.working_distance
    for pose in (upright, rolled, leaning):
        np.testing.assert_allclose(pose @ np.array([0, 0, distance]), hole.centre_on_seen_face)
    assert upright.rotation[2, 1] < -0.9  # the image's y axis points down the body


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -1), (0.02, 0, 0.9998), (1, 0, 0)])
def test_a_hole_that_faces_anywhere_has_a_pose(papers, normal):
    unit = np.array(normal) / np.linalg.norm(normal)
    hole = dataclasses.replace(papers.holes[0], normal=unit)
    camera = papers.calibration.body_from_camera(compute_pose(Stop(hole="A"), hole,
                                                              papers.calibration))
    np.testing.assert_allclose(camera.rotation[:, 2], -hole.normal_to_camera, atol=1e-8)


def test_the_aim_leaves_an_optic_axis_that_lies_outside_the_image(papers):
    document = papers.calibration.sensor
    (fx, skew, _), second, last = document.camera_matrix
    shifted = document.model_copy(update={"camera_matrix": ((fx, skew, 2000.0), second, last),
                                          "distortion": (0.0,) * 5})
    aim = choose_aim(shifted.model)
    np.testing.assert_allclose(shifted.model.camera.project(aim), [383.5, 287.5], atol=1e-6)
    assert abs(shifted.model.light_plane.distance(aim)) < 1e-9
    assert choose_aim(document.model, 260.0)[2] == 260.0


def test_a_stand_off_replaces_the_working_distance(papers):
    near, far = planned(papers)[0], planned(changed(papers, stand_off_mm=246.0))[0]
    gap = near.base_from_flange.distance(far.base_from_flange)[0]
    assert gap == pytest.approx(246.0 - papers.calibration.sensor.model.working_distance, abs=1e-6)


def test_all_stops_stay_on_the_branch_of_home_and_within_the_limits(papers):
    home = np.radians(papers.station.home_deg)
    for stop in planned(papers):
        for joints in (stop.joints, stop.approach):
            assert np.sign(np.sin(joints[2])) == np.sign(np.sin(home[2]))
            assert np.sign(np.sin(joints[4])) == np.sign(np.sin(home[4]))
            for angle, (low, high) in zip(np.degrees(joints), papers.station.limits.joints_deg,
                                          strict=True):
                assert low <= angle <= high


def test_the_way_is_one_chain_from_home_to_home(papers):
    home = tuple(np.radians(papers.station.home_deg))
    legs = list(walk(planned(papers), home))
    assert legs[0].start == legs[-1].end == "home"
    for leg, following in pairwise(legs):
        assert leg.end == following.start
        assert leg.joints[1] == following.joints[0]
    assert all(leg.slow for leg in legs if "approach" in leg.start and "approach" not in leg.end
               and "via" not in leg.end and leg.end != "home")


def narrow(papers, joint, low, high):
    limits = list(papers.station.limits.joints_deg)
    limits[joint] = (low, high)
    return changed(papers, joints_deg=tuple(limits))


def test_what_cannot_be_is_refused_with_the_reason(papers):
    far = [dataclasses.replace(hole, centre=np.add(hole.centre, [0, 900, 0]))
           for hole in papers.holes]
    assert "out of reach" in refusal(dataclasses.replace(papers, holes=tuple(far)))
    message = refusal(narrow(papers, 5, 162.0, 260.0))
    assert "joint 6 at" in message
    assert "allowed are 162 to 260" in message
    assert "singularity" in refusal(changed(papers, singularity_margin_deg=50.0))
    assert "leaves the workspace: z" in refusal(changed(papers, workspace=Box(
        name="low", min=(200.0, -900.0, -60.0), max=(1100.0, 600.0, 600.0))))


def test_a_refusal_names_the_stop_and_all_of_them_are_counted(papers):
    message = refusal(narrow(papers, 0, 100.0, 140.0))
    assert message.startswith("job demo: stop BP5: ")
    assert "; and " in message


def test_an_obstacle_between_two_stops_is_met(papers):
    stops = planned(papers)
    middle = ARM.forward(tuple(np.mean([stops[12].approach, stops[13].approach], axis=0)))
    corner = middle @ np.array(papers.station.limits.sensor_points[0])
    post = Box(name="post", min=tuple(corner - 8.0), max=tuple(corner + 8.0))
    blocked = changed(papers, keep_out=(*papers.station.limits.keep_out, post))
    message = refusal(blocked)
    here, there = stops[12].hole.id, stops[13].hole.id
    assert f"stop {there}: on the way from {here} approach to {there} approach" in message
    assert "'post'" in message


def test_a_post_thinner_than_the_sensor_does_not_slip_between_its_points(papers):
    stop = planned(papers)[0]
    pose = ARM.forward(stop.joints)
    points = np.array(papers.station.limits.sensor_points)
    inside = pose @ (points.T @ np.random.default_rng(0).dirichlet(np.ones(len(points))))
    thin = Box(name="wire", min=tuple(inside - 1.0), max=tuple(inside + 1.0))
    limits = papers.station.limits.model_copy(update={"keep_out": (thin,)})
    assert (np.linalg.norm(pose @ points - inside, axis=1) > 30.0).all()
    standing = Leg("here", "there", (stop.joints, stop.joints))
    assert "'wire'" in " ".join(check_leg(standing, limits, ARM).problems)


def test_a_via_point_leads_round_an_obstacle(papers):
    ends = [stop for stop in papers.job.stops if stop.hole in ("RR1", "QP1")]
    first, second = planned(changed(papers, stops=tuple(ends)))
    middle = np.mean([first.approach, second.approach], axis=0)
    ahead = ARM.forward(tuple(middle)) @ np.mean(papers.station.limits.sensor_points, axis=0)
    post = Box(name="post", min=tuple(ahead - 10.0), max=tuple(ahead + 10.0))
    keep_out = (*papers.station.limits.keep_out, post)
    assert "'post'" in refusal(changed(papers, keep_out=keep_out, stops=tuple(ends)))
    via = Via(joints_deg=tuple(np.add(np.degrees(middle), [0, -30, 40, -10, 0, 0])))
    round_it = (ends[0], ends[1].model_copy(update={"via": (via,)}))
    way = planned(changed(papers, keep_out=keep_out, stops=round_it))
    assert way[1].via == (tuple(np.radians(via.joints_deg)),)


def test_a_taught_pose_that_does_not_see_its_hole_is_refused(papers):
    stops = list(papers.job.stops)
    taught = next(stop for stop in stops if stop.joints_deg)
    turned = np.add(taught.joints_deg, [4.0, 0, 0, 0, 0, 0])
    stops[stops.index(taught)] = taught.model_copy(update={"joints_deg": tuple(turned)})
    assert "the hole would not lie in the image" in refusal(changed(papers, stops=tuple(stops)))


def test_what_would_not_be_seen_is_said(papers):
    hole, calibration = papers.holes[0], papers.calibration
    pose = compute_pose(Stop(hole="A"), hole, calibration)
    assert find_sight_problem(hole, pose, calibration) is None
    other_side = dataclasses.replace(hole, side="back", thickness=0.0)
    assert "from its normal" in find_sight_problem(other_side, pose, calibration)
    back = step_back(pose, calibration, 18.0)
    small = dataclasses.replace(hole, diameter=5.0)
    assert "stripe would miss" in find_sight_problem(small, back, calibration)
    behind = step_back(pose, calibration, -600.0)
    assert "behind the camera" in find_sight_problem(hole, behind, calibration)


def test_a_plan_with_refusals_still_has_its_other_stops(papers):
    holes = [dataclasses.replace(hole, centre=np.add(hole.centre, [0, 900, 0])) if hole.id == "SI3"
             else hole for hole in papers.holes]
    plan = draw_plan(papers.job, holes, papers.calibration, papers.station, ARM)
    assert len(plan.stops) == 23
    assert [stop for stop, _ in plan.refusals] == ["SI3"]


def test_the_time_of_a_leg_is_that_of_a_trapezoid(papers):
    robot = papers.station.robot
    long = Leg("a", "b", ((0.0,) * 6, (2.0, 1.0, 0.0, 0.0, 0.0, 0.0)))
    short = Leg("a", "b", ((0.0,) * 6, (0.02, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert long.duration(robot) == pytest.approx(2.0 + 0.5)  # 1 rad/s, 2 rad/s²
    assert short.duration(robot) == pytest.approx(2 * np.sqrt(0.02 / 2.0))


def test_datums_that_could_not_hold_the_body_are_refused(papers):
    alignment = papers.job.alignment.model_copy(update={
        "method": "rps", "datums": {"SI1": "z", "SI2": "z", "SI3": "z", "SI4": "z", "SI5": "z",
                                    "RR1": "z"}})
    assert "alignment: the datums do not hold the body" in refusal(
        changed(papers, alignment=alignment))


def test_stepping_back_and_forth_is_nothing(papers):
    pose = Transform.from_parts([0.1, 0.7, -0.3], [400.0, 100.0, 500.0])
    there = step_back(pose, papers.calibration, 35.0)
    assert there.distance(pose)[0] == pytest.approx(35.0)
    assert step_back(there, papers.calibration, -35.0).distance(pose)[0] < 1e-6
