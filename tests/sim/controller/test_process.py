"""The emulator as a process: its address, its end, its cost, and the real client that drives it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cell.core.errors import DeviceError
from cell.sim.controller.process import EmulatedController

pytest.importorskip("rtde_control", reason="ur-rtde is not installed")

CLIENT = """
import json, os, sys, time
import numpy as np
import rtde_control, rtde_receive
address = sys.argv[1]
receive = rtde_receive.RTDEReceiveInterface(address)
control = rtde_control.RTDEControlInterface(address, 125.0)
goal = (np.array(receive.getActualQ()) + [0.3, -0.2, 0.1, 0.2, -0.1, 0.4]).tolist()
answers = {"joint_move": control.moveJ(goal, 2.0, 4.0)}
answers["joints_off"] = float(np.abs(np.subtract(receive.getActualQ(), goal)).max())
line = receive.getActualTCPPose()
line[2] += 0.05
answers["line_move"] = control.moveL(line, 0.5, 2.0)
answers["line_off"] = float(np.abs(np.subtract(receive.getActualTCPPose(), line)[:3]).max())
answers["forward"] = control.getForwardKinematics()
answers["pose"] = receive.getActualTCPPose()
answers["inverse"] = control.getInverseKinematics(line)
answers["joints"] = receive.getActualQ()
answers["steady"] = control.isSteady()
answers["within"] = control.isPoseWithinSafetyLimits(line)
line[0] += 3.0
answers["beyond"] = control.isPoseWithinSafetyLimits(line)
answers["unreachable"] = control.moveL(line, 0.5, 2.0)
print(json.dumps(answers), flush=True)
os._exit(0)
"""


def wait_for_end(pid, seconds=5.0):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            status = Path(f"/proc/{pid}/stat").read_text()
            if status.rsplit(")", 1)[1].split()[0] == "Z":
                return True
        except FileNotFoundError:
            return True
        time.sleep(0.02)
    return False


def test_the_real_client_drives_it():
    with EmulatedController("ur10e", speed=4.0) as emulator:
        client = subprocess.run([sys.executable, "-c", CLIENT, emulator.address], timeout=60,
                                capture_output=True, text=True, check=True)
    answers = json.loads(client.stdout.splitlines()[-1])
    assert answers["joint_move"] is True
    assert answers["line_move"] is True
    assert answers["joints_off"] < 1e-6
    assert answers["line_off"] < 1e-6
    assert answers["forward"] == pytest.approx(answers["pose"], abs=1e-9)
    assert answers["inverse"] == pytest.approx(answers["joints"], abs=1e-6)
    assert answers["steady"] is True
    assert answers["within"] is True
    assert answers["beyond"] is False
    assert answers["unreachable"] is False


def test_each_one_has_an_address_of_its_own():
    with EmulatedController("ur5e") as one, EmulatedController("ur5e") as other:
        assert one.address != other.address
        assert one.address.startswith("127.")


def test_an_address_that_is_taken_is_refused_with_the_reason():
    with (EmulatedController("ur5e") as first,
          pytest.raises(DeviceError, match=f"listen at {first.address}")):
        EmulatedController("ur5e", address=first.address).start()


def test_stopping_twice_is_fine_and_it_is_gone():
    emulator = EmulatedController("ur3e").start()
    pid = emulator.pid
    emulator.stop()
    emulator.stop()
    assert wait_for_end(pid)


@pytest.mark.parametrize("frozen", [False, True])
def test_it_dies_with_its_parent_even_when_that_is_killed(frozen):
    parent = subprocess.Popen(
        [sys.executable, "-c",
         "import time; from cell.sim.controller.process import EmulatedController as E\n"
         "e = E('ur5e').start(); print(e.pid, flush=True); time.sleep(60)"],
        stdout=subprocess.PIPE, text=True)
    pid = int(parent.stdout.readline())
    if frozen:
        os.kill(pid, signal.SIGSTOP)
    parent.kill()
    parent.communicate()
    assert wait_for_end(pid)


def test_idle_it_costs_next_to_nothing():
    with EmulatedController("ur10e") as emulator:
        before = json.loads(emulator.tell_referee("truth"))["cpu_s"]
        time.sleep(2.0)
        assert json.loads(emulator.tell_referee("truth"))["cpu_s"] - before < 0.2
