"""A controller as new for every test, and the driver that talks to it."""

import json

import pytest

from cell.core.documents.station import RobotSettings
from cell.devices.ur import UrLights, UrRobot
from cell.sim.controller.process import EmulatedController

pytest.importorskip("rtde_control", reason="ur-rtde is not installed")

SPEED = 3.0


@pytest.fixture
def settings():
    return RobotSettings(driver="sim", model="ur10e", digital_output_ring=2, digital_output_laser=5)


@pytest.fixture(scope="module")
def running_emulator():
    with EmulatedController("ur10e", speed=SPEED) as running:
        yield running


@pytest.fixture
def emulator(running_emulator):
    """A controller as if it had just been started."""
    running_emulator.tell_referee("restart")
    return running_emulator


@pytest.fixture
def mortal_emulator():
    """A controller that the test may kill."""
    with EmulatedController("ur10e", speed=SPEED) as running:
        yield running


@pytest.fixture
def robot(emulator, settings):
    made = UrRobot(settings, emulator.address, SPEED)
    yield made
    made.close()


@pytest.fixture
def lights(robot, settings):
    return UrLights(robot, settings)


@pytest.fixture
def truth(emulator):
    return lambda: json.loads(emulator.tell_referee("truth"))


@pytest.fixture
def burning(truth):
    names = {2: "ring", 5: "laser"}
    return lambda: {name for output, name in names.items() if truth()["outputs"] >> output & 1}
