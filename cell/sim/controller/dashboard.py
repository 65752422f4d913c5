"""The dashboard server, port 29999: a line in, a line out, in the words that clients compare."""

from __future__ import annotations

from collections.abc import Callable

from cell.sim.controller.controller import Controller, RobotMode, Runtime, Safety

GREETING = "Connected: Universal Robots Dashboard Server"
VERSION = "URSoftware 5.14.0.1031110 (May 11 2023)"
TOO_EARLY = ("Cannot unlock protective stop until 5s after occurrence. Always inspect cause of "
             "protective stop before unlocking")
MODES = {RobotMode.POWER_OFF: "POWER_OFF", RobotMode.POWER_ON: "POWER_ON", RobotMode.IDLE: "IDLE",
         RobotMode.RUNNING: "RUNNING"}
PROGRAM = "rtde_control.urp"


class Dashboard:
    """The commands of the dashboard; what moves or starts something needs remote control."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._questions: dict[str, Callable[[], str]] = {
            "polyscopeversion": lambda: VERSION,
            "version": lambda: VERSION.split()[1],
            "get serial number": lambda: controller.serial,
            "get robot model": lambda: controller.arm.build.name,
            "robotmode": lambda: f"Robotmode: {MODES[controller.robot_mode]}",
            "safetymode": lambda: f"Safetymode: {self._safety}",
            "safetystatus": lambda: f"Safetystatus: {self._safety}",
            "is in remote control": lambda: str(controller.remote_control).lower(),
            "running": lambda: f"Program running: {str(controller.playing).lower()}",
            "programstate": self._program_state,
            "get loaded program": lambda: f"Loaded program: {PROGRAM}",
            "close popup": self._close_popup, "close safety popup": self._close_popup,
            "quit": lambda: "Disconnected", "addtolog": lambda: "Added log message",
            "popup": lambda: "showing popup",
        }
        self._actions: dict[str, Callable[[], str]] = {
            "stop": self._stop, "pause": self._pause, "play": self._play,
            "unlock protective stop": self._unlock, "restart safety": self._restart_safety,
            "power on": lambda: self._power(RobotMode.IDLE, "Powering on"),
            "brake release": lambda: self._power(RobotMode.RUNNING, "Brake releasing"),
            "power off": lambda: self._power(RobotMode.POWER_OFF, "Powering off"),
        }

    def answer(self, line: str) -> str:
        """Answer one command."""
        command = line.strip().lower()
        if command.startswith(("popup ", "addtolog ")):
            command = command.split()[0]
        if command in self._actions:
            if not self._controller.remote_control:
                return f"Failed to execute: {line.strip()}"
            return self._actions[command]()
        return self._questions.get(command, lambda: f"could not understand: '{line.strip()}'")()

    @property
    def _safety(self) -> str:
        safety = self._controller.safety
        return "ROBOT_EMERGENCY_STOP" if safety is Safety.EMERGENCY_STOP else safety.name

    def _program_state(self) -> str:
        running = self._controller.runtime
        state = running.name if running in (Runtime.PLAYING, Runtime.PAUSED) else "STOPPED"
        return f"{state} {PROGRAM}"

    def _close_popup(self) -> str:
        self._controller.popup = ""
        return "closing popup"

    def _stop(self) -> str:
        self._controller.end_program()
        return "Stopped"

    def _pause(self) -> str:
        if not self._controller.playing:
            return "Failed to execute: pause"
        self._controller.pause()
        return "Pausing program"

    def _play(self) -> str:
        stopped = self._controller.safety not in (Safety.NORMAL, Safety.REDUCED)
        if stopped or self._controller.runtime is not Runtime.PAUSED:
            return "Failed to execute: play"
        self._controller.play()
        return "Starting program"

    def _unlock(self) -> str:
        return "Protective stop releasing" if self._controller.unlock() else TOO_EARLY

    def _restart_safety(self) -> str:
        self._controller.restart_safety()
        return "Restarting safety"

    def _power(self, wanted: RobotMode, answer: str) -> str:
        self._controller.power(wanted)
        return answer
