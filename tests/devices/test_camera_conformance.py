"""One suite over every camera: what the port promises."""

import time

import numpy as np
import pytest
from made_cameras import HandMovedController, VideoStream
from made_scenes import DEMO, over_hole

from cell.core.documents.station import CameraSettings
from cell.core.errors import DeviceError
from cell.core.ports import CameraTimeoutError
from cell.devices.video import VideoCamera
from cell.sim.camera import SimulatedCamera


class SimulatedStage:
    """A simulated camera over a hole of the demo's body, with the ring light as the lamp."""

    size = (768, 576)

    def __init__(self):
        self.controller = HandMovedController()
        self.controller.stand(over_hole("SI3"))
        self.camera = SimulatedCamera(DEMO, self.controller.address, speed=10.0, timeout=20.0)

    def light(self, on):
        self.controller.outputs = int(on)

    def lose_an_image(self):
        self.camera._timeout = 0.5
        self.camera.set_fault("late_image", 1)

    def find_it_again(self):
        self.camera._timeout = 20.0

    def lose_the_camera(self):
        self.camera.set_fault("lost")

    def close(self):
        self.camera.close()
        self.controller.close()


class VideoStage:
    """A camera behind a stream on loopback that shows everything late."""

    size = (320, 240)

    def __init__(self):
        self.stream = VideoStream(size=self.size)
        settings = CameraSettings(driver="video", source=self.stream.address, stale_s=0.3,
                                  timeout_s=1.0)
        self.camera = VideoCamera(settings)

    def light(self, on):
        self.stream.lit = on

    def lose_an_image(self):
        self.stream.frozen = True

    def find_it_again(self):
        self.stream.frozen = False

    def lose_the_camera(self):
        self.stream.close()

    def close(self):
        self.camera.close()
        self.stream.close()


@pytest.fixture(params=[SimulatedStage, VideoStage])
def stage(request):
    made = request.param()
    yield made
    made.close()


def test_says_its_size_and_gives_mono_images_of_it(stage):
    assert stage.camera.open() == stage.size
    image = stage.camera.snap(0.008)
    assert image.shape == stage.size[::-1]
    assert image.dtype == np.uint8


def test_nothing_exposed_before_the_lamp_changed_comes(stage):
    """The late image and the stale queue are the same trap: one picture behind, for ever."""
    stage.camera.open()
    for turn in range(6):
        on = turn % 2 == 0
        stage.light(on)
        middle = np.median(stage.camera.snap(0.008))
        assert (middle > 60) == on, f"turn {turn}"


def test_it_tells_how_warm_it_is_or_nothing(stage):
    warmth = stage.camera.temperature()
    assert warmth is None or 10.0 < warmth < 60.0


def test_an_image_that_does_not_come_is_a_timeout_and_the_next_is_right(stage):
    stage.camera.open()
    stage.light(True)
    stage.lose_an_image()
    with pytest.raises(CameraTimeoutError):
        stage.camera.snap(0.008)
    stage.find_it_again()
    stage.light(False)
    assert np.median(stage.camera.snap(0.008)) < 60


def test_a_lost_camera_is_a_device_error(stage):
    stage.camera.open()
    stage.lose_the_camera()
    with pytest.raises(DeviceError):
        for _ in range(3):
            stage.camera.snap(0.008)


def test_closed_it_takes_no_image_and_closing_is_quick_and_repeatable(stage):
    stage.camera.open()
    begun = time.monotonic()
    stage.camera.close()
    stage.camera.close()
    assert time.monotonic() - begun < 10.0
    with pytest.raises(DeviceError, match="not open"):
        stage.camera.snap(0.008)


def test_it_opens_again(stage):
    for _ in range(2):
        assert stage.camera.open() == stage.size
        stage.light(True)
        assert np.median(stage.camera.snap(0.008)) > 60
        stage.camera.close()
