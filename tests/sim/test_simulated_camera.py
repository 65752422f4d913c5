"""The simulated camera behaves as hardware does, traps included, and can be played upon."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_cameras import HandMovedController
from made_scenes import DEMO, over_hole

from cell.core.errors import DeviceError
from cell.core.geometry import Transform
from cell.core.kinematics import arm_for
from cell.sim.bodies import Delivery
from cell.sim.camera import SimulatedCamera
from cell.sim.camera_feed import ControllerFeed
from cell.sim.controller.process import EmulatedController

RING, LASER = 1, 2


@pytest.fixture(scope="module")
def controller():
    server = HandMovedController()
    yield server
    server.close()


@pytest.fixture(scope="module")
def opened(controller):
    camera = SimulatedCamera(DEMO, controller.address, speed=10.0, timeout=20.0)
    controller.stand(over_hole("SI3"))
    camera.open()
    yield camera
    camera.close()


@pytest.fixture
def camera(opened, controller):
    controller.stand(over_hole("SI3"))
    controller.outputs = 0
    opened.deliver(Delivery(opened.scene.seed))
    for fault in ("late_image", "lost_trigger", "dark_laser", "dark_ring", "wrong_size"):
        opened.set_fault(fault, 0)
    opened.rearm()
    return opened


def dark_centre(image):
    """The middle of the dark hole in an image of light sheet."""
    rows, columns = np.nonzero(image < 40)
    return np.array([columns.mean(), rows.mean()])


def test_lamps_are_seen_as_they_burn(camera, controller):
    levels = {}
    for outputs in (0, RING, LASER, RING | LASER):
        controller.outputs = outputs
        image = camera.snap(0.008)
        levels[outputs] = np.median(image), np.percentile(image, 99.9)
    assert levels[0][0] < 15 > levels[0][1]
    assert levels[RING][0] > 60
    assert levels[LASER][0] < 15
    assert levels[LASER][1] > 60
    assert levels[RING | LASER][1] > levels[RING][1]


def test_the_pose_is_taken_when_the_exposure_begins(camera, controller):
    controller.outputs = RING
    before = dark_centre(camera.snap(0.008))
    pose = over_hole("SI3")
    controller.stand(pose @ Transform.from_parts(np.zeros(3), [3.0, 0.0, 0.0]))
    moved = dark_centre(camera.snap(0.008)) - before
    assert np.linalg.norm(moved) == pytest.approx(3.0 / 242.4 * 3480, rel=0.05)


def test_an_active_tcp_does_not_move_the_camera(camera, controller):
    controller.outputs = RING
    pose = over_hole("SI3")
    plain = dark_centre(camera.snap(0.008))
    offset = Transform.from_parts([0.1, -0.2, 0.3], [50.0, -20.0, 130.0])
    controller.stand(pose @ offset)
    controller.offset = np.concatenate([offset.translation / 1000, offset.rotation_vector])
    seen = dark_centre(camera.snap(0.008))
    controller.offset = np.zeros(6)
    assert seen == pytest.approx(plain, abs=0.5)


def test_an_exposure_takes_its_time(camera, controller):
    begun = time.monotonic()
    camera.snap(10.0)
    assert time.monotonic() - begun > 1.0  # at ten times real time


def test_a_longer_exposure_is_brighter_until_it_saturates(camera, controller):
    controller.outputs = RING
    dark, light, white = (np.median(camera.snap(t)) for t in (0.002, 0.004, 0.2))
    assert (light - 4) / (dark - 4) == pytest.approx(2.0, rel=0.05)
    assert white == 255


def test_a_trigger_while_an_exposure_is_under_way_is_lost(camera):
    for _ in range(5):
        camera.fire(0.5)
    images = 0
    while camera.fetch(1.5) is not None:
        images += 1
    assert images == 1


def test_a_late_image_stays_queued_and_snap_is_not_deceived(camera, controller):
    """The bare device gives the picture before the last for ever; `snap` re-arms."""
    camera._timeout = 0.4
    camera.set_fault("late_image", 1)
    camera._timeout = 20.0
    controller.outputs = RING
    camera.fire(0.008)
    assert camera.fetch(0.4) is None
    time.sleep(1.5)
    controller.outputs = 0
    camera.fire(0.008)
    assert np.median(camera.fetch(20.0)) > 60  # asked in the dark, got the light picture
    camera.rearm()
    assert np.median(camera.snap(0.008)) < 15


@pytest.mark.parametrize(("fault", "outputs"), [("dark_ring", RING), ("dark_laser", LASER)])
def test_a_dead_lamp_is_dark(camera, controller, fault, outputs):
    controller.outputs = outputs
    camera.set_fault(fault, 1)
    assert np.percentile(camera.snap(0.008), 99.9) < 15
    assert np.percentile(camera.snap(0.008), 99.9) > 60


def test_an_image_of_another_size_is_refused(camera):
    camera.set_fault("wrong_size", 1)
    with pytest.raises(DeviceError, match="384 x 288 pixels came, not of 768 x 576"):
        camera.snap(0.008)


def test_another_body_is_seen_and_told_elsewhere(camera, controller):
    controller.outputs = RING
    camera.deliver(replace(Delivery(1), displacement=(0.0,) * 6))
    first, truth = dark_centre(camera.snap(0.008)), hole(camera.truth(), "SI3")
    camera.deliver(replace(Delivery(1), displacement=(0.0, 0.0, 0.0, 1.5, 0.0, 0.0)))
    second, moved = dark_centre(camera.snap(0.008)), hole(camera.truth(), "SI3")
    assert np.subtract(moved["centre_mm"], truth["centre_mm"]) == pytest.approx([1.5, 0, 0])
    assert np.linalg.norm(second - first) == pytest.approx(1.5 / 242.4 * 3480, rel=0.05)


def test_the_picture_repeats_but_for_its_noise(camera, controller):
    """Standing still, stripe and speckle stay: averaging over them does not help."""
    controller.outputs = LASER
    one, two = (camera.snap(0.004).astype(float) for _ in range(2))
    bright = one > 40
    assert np.abs(one - two)[bright].mean() < 0.1 * one[bright].mean()
    assert (one != two).any()


def test_it_follows_the_emulated_controller():
    """Two kinematics written apart agree on where the flange is; the lamps are its outputs."""
    joints = np.radians([153.0, -93.0, 114.0, -13.0, 59.0, 164.0])
    with EmulatedController("ur10e", joints=tuple(joints)) as emulator:
        feed = ControllerFeed(emulator.address, 5.0)
        feed.open()
        readings = feed.renew(time.monotonic() + 10.0)
        feed.close()
    assert readings[-1].joints == pytest.approx(joints, abs=1e-9)
    millimetres, angle = readings[-1].base_from_flange.distance(arm_for("ur10e").forward(joints))
    assert millimetres < 1e-6
    assert angle < 1e-9
    assert readings[-1].outputs == 0


def test_no_controller_is_said_at_once():
    camera = SimulatedCamera(DEMO, "127.99.255.254")
    with pytest.raises(DeviceError, match=r"no RTDE from the controller at 127\.99\.255\.254"):
        camera.open()
    camera.close()


def test_a_controller_that_does_not_report_what_is_needed_is_refused():
    server = HandMovedController(missing=("tcp_offset",))
    camera = SimulatedCamera(DEMO, server.address)
    with pytest.raises(DeviceError, match="does not report"):
        camera.open()
    camera.close()
    server.close()


def test_a_controller_that_goes_leaves_the_lamps_dark_and_may_come_back():
    server = HandMovedController()
    server.stand(over_hole("SI3"))
    server.outputs = RING
    camera = SimulatedCamera(DEMO, server.address, speed=10.0, timeout=20.0)
    camera.open()
    assert np.median(camera.snap(0.008)) > 60
    server.silent = True
    assert np.median(camera.snap(0.008)) < 15
    server.silent = False
    assert np.median(camera.snap(0.008)) > 60
    camera.close()
    server.close()


def test_the_camera_dies_with_its_program(controller):
    program = ("import sys; from pathlib import Path; from cell.sim.camera import SimulatedCamera\n"
               f"camera = SimulatedCamera(Path({str(DEMO)!r}), {controller.address!r})\n"
               "camera.open(); print(camera._process.pid, flush=True); sys.stdin.read()")
    parent = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    deadline = time.monotonic() + 10.0
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not alive(child)


def alive(pid):
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def hole(truth, name):
    return next(entry for entry in truth["holes"] if entry["id"] == name)
