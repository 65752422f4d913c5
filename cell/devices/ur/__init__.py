"""A Universal Robots arm and the lights on its digital outputs, through ur-rtde.

The driver's house rules, each for a reason that was measured: every ur-rtde object lives in one
child process that can be thrown away (`worker`), since its constructors hold the GIL without a time
limit and a dropped connection crashes the process it is in; the parent checks the controller by
plain sockets before (`preflight`), holds the stop channel itself (`dashboard`), and believes an
arrival only when program, progress, speed and position agree (`robot`). The robot's own watchdog
ends the program, and with it the outputs, when this software is gone.
"""

from cell.devices.ur.lights import UrLights
from cell.devices.ur.robot import UrRobot

__all__ = ["UrLights", "UrRobot"]
