"""What a UR controller's state words and bits mean to a program that wants to move the arm."""

from __future__ import annotations

from cell.core.ports import RobotStoppedError

PLAYING = 2  # runtime_state
PAUSED = (3, 4)
MAY_MOVE = ("NORMAL", "REDUCED")  # safety modes
ADVICE = {
    "protective_stop": "look for the cause, then recover the robot",
    "safeguard_stop": "close the safeguard, then recover the robot",
    "emergency_stop": "make the cell safe, release the button, then recover the robot",
    "local_mode": "switch the pendant to remote control, then recover the robot",
    "paused": "the program was paused at the pendant; recover the robot",
    "lost": "recover the robot",
}


def state_of_safety(name: str) -> str | None:
    """Name the stop that a dashboard's safety mode stands for; None if the arm may move."""
    if name in MAY_MOVE:
        return None
    if name in ("PROTECTIVE_STOP", "SAFEGUARD_STOP"):
        return name.lower()
    return "emergency_stop" if "EMERGENCY" in name or name in ("VIOLATION", "FAULT") else "lost"


def state_of_bits(safety_bits: int, runtime: int) -> str | None:
    """Name the stop that RTDE's `safety_status_bits` and `runtime_state` show; None if none.

    The safeguard stop is in bits 4 and 10 alone: the client's own questions about protective and
    emergency stops do not see it.
    """
    for bits, state in ((0b11_1110_0000, "emergency_stop"), (1 << 4, "safeguard_stop"),
                        (1 << 2 | 1 << 10, "protective_stop")):
        if safety_bits & bits:
            return state
    return "paused" if runtime in PAUSED else None


def stopped(state: str, detail: str = "") -> RobotStoppedError:
    """Make the error of a stop, with what to do about it."""
    words = state.replace("_", " ")
    reason = f": {detail}" if detail else ""
    return RobotStoppedError(f"stopped ({words}){reason}; {ADVICE[state]}", state=state)
