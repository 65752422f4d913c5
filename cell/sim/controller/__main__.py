"""Start one emulated controller: `python -m cell.sim.controller --model ur10e`.

Prints one line of JSON with its address when its ports are open, and ends with its parent.
"""

from __future__ import annotations

import argparse
import ctypes
import itertools
import json
import math
import os
import signal
import sys
from collections.abc import Iterator

from cell.sim.controller.arm import BUILDS
from cell.sim.controller.controller import Controller
from cell.sim.controller.server import Server

DIE_WITH_PARENT = 1  # prctl's PR_SET_PDEATHSIG
ADDRESSES_TRIED = 200


def main() -> None:
    """Serve until the parent goes or a signal ends it."""
    options = _options()
    parent = options.parent
    if parent:
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    server = _serve_at(options.address, Controller(options.model, options.speed,
                                                       joints=options.joints), options.rate)
    ready = {"address": server.address, "pid": os.getpid(), "model": options.model}
    sys.stdout.write(json.dumps(ready) + "\n")
    sys.stdout.flush()
    server.run(lambda: not parent or os.getppid() == parent)


def _serve_at(address: str | None, controller: Controller, rate: float) -> Server:
    """Open the ports at the address, or at a loopback address where all of them are free."""
    reason: OSError | None = None
    for candidate in [address] if address else itertools.islice(_free_addresses(), ADDRESSES_TRIED):
        try:
            return Server(controller, candidate, rate)
        except OSError as error:
            reason = error
    sys.exit(f"no controller can listen at {address or 'any loopback address'}: {reason}")


def _free_addresses() -> Iterator[str]:
    """Walk loopback addresses from one that the process number chooses."""
    for number in itertools.count(os.getpid() * 7):
        yield f"127.{1 + number // 62500 % 250}.{1 + number // 250 % 250}.{2 + number % 250}"


def _radians(degrees: str) -> list[float]:
    """Read six angles in degrees, separated by commas."""
    joints = [math.radians(float(angle)) for angle in degrees.split(",")]
    if len(joints) != 6:
        raise argparse.ArgumentTypeError("expected six angles")
    return joints


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m cell.sim.controller", description=__doc__)
    parser.add_argument("--model", choices=sorted(BUILDS), default="ur10e")
    parser.add_argument("--address", help="a loopback address, 127.x.y.z; a free one if not given")
    parser.add_argument("--speed", type=float, default=1.0, help="time runs faster by this factor")
    parser.add_argument("--rate", type=float, default=125.0, help="cycles a second")
    parser.add_argument("--joints", type=_radians, help="where the arm stands, in degrees: 0,-90,…")
    parser.add_argument("--parent", type=int, default=0, help="end when this process has gone")
    return parser.parse_args()


if __name__ == "__main__":
    main()
