"""The way back after a stop, once a person has agreed to it: dashboard orders, each waited for."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from cell.core.errors import DeviceError
from cell.devices.ur.dashboard import Dashboard
from cell.devices.ur.preflight import safety_mode
from cell.devices.ur.states import MAY_MOVE, state_of_safety, stopped

UNLOCK_SECONDS = 15.0   # the controller refuses to unlock during the first five
SAFETY_SECONDS = 5.0
POWER_SECONDS = 40.0    # an arm that boots
POLL = 0.2


def clear_stop(dashboard: Dashboard) -> None:
    """Bring safety and power back to where a program may run; nothing moves.

    Raises:
        RobotStoppedError: a person has to act first (safeguard, button, local mode).
        DeviceError: an order had no effect in time.
    """
    if "true" not in dashboard.ask("is in remote control"):
        raise stopped("local_mode")
    dashboard.ask("stop")
    dashboard.ask("close safety popup")
    state = state_of_safety(safety_mode(dashboard))
    if state == "protective_stop":
        _unlock(dashboard)
    elif state == "emergency_stop":
        dashboard.ask("restart safety")
    elif state is not None:
        raise stopped(state, "it is still stopped")
    if not _wait(lambda: safety_mode(dashboard) in MAY_MOVE, SAFETY_SECONDS):
        raise stopped(state_of_safety(safety_mode(dashboard)) or "lost", "it is still stopped")
    _power_up(dashboard)


def _unlock(dashboard: Dashboard) -> None:
    def released() -> bool:
        return "releasing" in dashboard.ask("unlock protective stop")

    if not _wait(released, UNLOCK_SECONDS):
        raise stopped("protective_stop", "the controller does not unlock it")


def _power_up(dashboard: Dashboard) -> None:
    for order, reached in (("power on", ("IDLE", "RUNNING")), ("brake release", ("RUNNING",))):
        if _mode(dashboard) not in reached:
            dashboard.ask(order)
        if not _wait(partial(_mode_is_one_of, dashboard, reached), POWER_SECONDS):
            raise DeviceError(f"`{order}` had no effect: the arm is in mode {_mode(dashboard)}",
                              device="robot")


def _mode_is_one_of(dashboard: Dashboard, modes: tuple[str, ...]) -> bool:
    return _mode(dashboard) in modes


def _mode(dashboard: Dashboard) -> str:
    return dashboard.ask("robotmode").rpartition(" ")[2]


def _wait(true: Callable[[], bool], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while not true():
        if time.monotonic() > deadline:
            return False
        time.sleep(POLL)
    return True
