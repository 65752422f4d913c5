"""The UR driver against the emulated controller does what every robot must do."""

from devices.robot_conformance import LightsConformance, RobotConformance, opened  # noqa: F401


class TestUrRobot(RobotConformance):
    pass


class TestUrLights(LightsConformance):
    pass
