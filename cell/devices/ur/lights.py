"""The ring light and the laser on two digital outputs of the controller.

Wired and configured as the README says, the outputs fall when the program on the controller ends:
that is what switches the laser off when this software cannot.
"""

from __future__ import annotations

from cell.core.documents.station import RobotSettings
from cell.core.errors import DeviceError
from cell.core.observation import Light
from cell.devices.ur.robot import UrRobot


class UrLights:
    """The lights of a cell. Implements the port `Lights`."""

    def __init__(self, robot: UrRobot, settings: RobotSettings) -> None:
        self._robot = robot
        self._outputs: dict[Light, int] = {"ring": settings.digital_output_ring,
                                           "laser": settings.digital_output_laser}

    def set(self, light: Light | None) -> None:
        """Switch exactly this light on and the other off, and wait until read back."""
        self._robot.set_outputs({output: name == light for name, output in self._outputs.items()})

    def off(self) -> None:
        """Switch both off, if need be by ending the program on the controller. Never raises."""
        try:
            if not self._robot.interrupted:
                self._robot.set_outputs(dict.fromkeys(self._outputs.values(), False))
                return
        except DeviceError:
            pass
        self._robot.stop()
