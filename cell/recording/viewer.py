"""The viewer's processes: bound to loopback, without analytics, ending with the one who began them.

The viewer binds to all interfaces and sends usage data unless told otherwise; here it is told.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun_cli  # type: ignore[import-untyped]

LOOPBACK = "127.0.0.1"
BINARY = Path(rerun_cli.__file__).parent / "rerun"  # the command of that name leaves it orphaned
LIVE_PORT = 9876  # where runs are shown live
ON_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG


@contextmanager
def viewer_process(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run the viewer's binary until the block is left.

    Args:
        arguments: what it is told beside the address to bind to.
    """
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [BINARY, "--bind", LOOPBACK, "--hide-welcome-screen", *arguments],
            env=os.environ | _without_analytics(Path(folder)), stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=dying_with_parent(signal.SIGTERM))
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def free_port() -> int:
    """Find a port of the loopback interface that nobody uses now."""
    with socket.socket() as trial:
        trial.bind((LOOPBACK, 0))
        return int(trial.getsockname()[1])


def hub_url(port: int) -> str:
    """Return where recordings are sent to and seen from."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def web_url(web_port: int, port: int) -> str:
    """Return the page for a browser on this machine."""
    return (f"http://{LOOPBACK}:{web_port}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{port}%2Fproxy"
            "&theme=dark&hide_welcome_screen=1")


def has_display() -> bool:
    """Tell whether a window can be opened here."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY")
                                           or os.environ.get("WAYLAND_DISPLAY"))


def _without_analytics(folder: Path) -> dict[str, str]:
    """Give the viewer a configuration of its own that says no. All keys are needed: one that it
    cannot read it replaces by its own, which says yes.
    """
    file = folder / "rerun" / "analytics.json"
    file.parent.mkdir()
    file.write_text(json.dumps({
        "analytics_enabled": False, "analytics_id": "none", "metadata": {},
        "config_file_path": str(file), "data_dir_path": str(folder)}))
    return {"XDG_CONFIG_HOME": str(folder), "XDG_DATA_HOME": str(folder)}


def dying_with_parent(number: signal.Signals) -> Callable[[], None]:
    """Make what a child process does first: ask for a signal when its parent dies."""
    libc = ctypes.CDLL(None)

    def ask() -> None:
        if sys.platform == "linux":
            libc.prctl(ON_PARENTS_DEATH, number)

    return ask
