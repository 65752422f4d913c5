"""`cell sim`: start the emulated robot controller alone, for any RTDE client to connect to."""

from __future__ import annotations

import ipaddress
import json
import os
import subprocess
import sys
from typing import Any

import typer

from cell.cli.words import answers, print_json
from cell.core.errors import DeviceError, DocumentError

HOME_DEG = "137.939,-109.974,123.23,1.512,47.073,157.747"  # of the demo cell: free to drive from

HOW_TO_CONNECT = """\
Emulated [bold]{model}[/bold] at [bold]{address}[/bold], time x{speed:g}

  RTDE       {address}:30004   protocol 2, up to 125 Hz
  dashboard  {address}:29999   lines of text: try `robotmode`
  scripts    {address}:30003   takes the program that ur-rtde uploads
  referee    {address}:29900   `truth`, and faults: `protective_stop`, `safeguard on`, `cut` …

In a cell's file:   robot: {{driver: ur, address: {address}, model: {model}}}
In Python:          rtde_receive.RTDEReceiveInterface("{address}")

Ctrl-C ends it."""


def sim(
    model: str = typer.Option("ur10e", help="ur3e, ur5e, ur10e, ur16e, ur20 or ur30."),
    address: str | None = typer.Option(None, help="A loopback address, 127.x.y.z; a free one is "
                                                  "chosen if not given."),
    speed: float = typer.Option(1.0, min=0.01, max=100.0, help="Time runs this many times faster."),
    joints_deg: str = typer.Option(HOME_DEG, metavar="A,B,C,D,E,F", help="Where the arm stands; "
                                   "the demo cell's home unless given."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object when it is ready."),
) -> None:
    """Start an emulated UR controller in the foreground and print how to connect to it.

    It speaks what an RTDE client needs (RTDE, dashboard, script upload), moves like the arm, and
    listens on the loopback interface only. Point a cell's file, ur-rtde or URSim's clients at it.
    """
    _check(model, address)
    process = _start(model, address, speed, _six_angles(joints_deg))
    try:
        ready = _read_ready(process)
        if as_json:
            print_json({"ok": True, **ready})
        else:
            answers.print(HOW_TO_CONNECT.format(speed=speed, **ready), highlight=False)
        process.wait()
    except KeyboardInterrupt:
        pass  # the way to end it
    finally:
        process.kill()
        process.wait()


def _check(model: str, address: str | None) -> None:
    from cell.core.kinematics import PUBLISHED_MM

    if model not in PUBLISHED_MM:
        raise DocumentError(f"unknown model {model!r}: expected one of {', '.join(PUBLISHED_MM)}",
                            place="--model")
    try:
        local = address is None or ipaddress.IPv4Address(address).is_loopback
    except ValueError:
        local = False
    if not local:
        raise DocumentError(f"expected a loopback address, 127.x.y.z, not {address!r}",
                            place="--address")


def _six_angles(text: str) -> str:
    """Refuse what is not six angles of a joint."""
    try:
        angles = [float(angle) for angle in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) != 6 or not all(abs(angle) <= 360.0 for angle in angles):
        raise DocumentError(f"expected six angles in degrees, such as {HOME_DEG}; came {text!r}",
                            place="--joints-deg")
    return text


def _start(model: str, address: str | None, speed: float, joints: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "cell.sim.controller", "--model", model, "--speed", str(speed),
               f"--joints={joints}", "--parent", str(os.getpid())]
    command += ["--address", address] if address else []
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            start_new_session=True)


def _read_ready(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdout is not None
    assert process.stderr is not None
    line = process.stdout.readline()
    if not line:
        raise DeviceError(process.stderr.read().strip(), device="emulator")
    ready: dict[str, Any] = json.loads(line)
    return ready
