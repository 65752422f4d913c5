"""`cell sim`: starts, says where, ends with Ctrl-C and takes nothing but loopback addresses."""

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

DEMO = Path(__file__).parents[2] / "calibration" / "demo"


def start(*words):
    return subprocess.Popen([sys.executable, "-m", "cell", "sim", *words], text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_it_serves_until_ctrl_c():
    running = start("--json", "--model", "ur5e")
    ready = json.loads(running.stdout.readline())
    assert ready["model"] == "ur5e"
    with socket.create_connection((ready["address"], 29999), timeout=5.0) as link:
        link.sendall(b"robotmode\n")
        answers = link.makefile()
        assert answers.readline().startswith("Connected")
        assert answers.readline() == "Robotmode: RUNNING\n"
        answers.close()
    running.send_signal(signal.SIGINT)
    running.communicate(timeout=10)
    assert running.returncode == 0
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((ready["address"], 29999), timeout=5.0)


def test_the_arm_stands_where_the_demo_cell_can_drive_from():
    home = yaml.safe_load((DEMO / "cell.yaml").read_text())["home_deg"]
    running = start("--json")
    address = json.loads(running.stdout.readline())["address"]
    with socket.create_connection((address, 29900), timeout=5.0) as referee:
        referee.sendall(b"truth\n")
        with referee.makefile() as answers:
            stands = json.loads(answers.readline())["joints"]
    running.kill()
    running.communicate()
    assert np.degrees(stands) == pytest.approx(home, abs=1e-3)


@pytest.mark.parametrize(("words", "complaint"), [
    (["--address", "10.0.0.1"], "expected a loopback address"),
    (["--address", "cell"], "expected a loopback address"),
    (["--model", "ur99"], "unknown model 'ur99'"),
    (["--joints-deg", "0,-90,0"], "expected six angles"),
    (["--joints-deg", "0,-90,0,nan,0,0"], "expected six angles")])
def test_what_cannot_be_is_refused(words, complaint):
    refused = start("--json", *words)
    answer, error = refused.communicate(timeout=30)
    assert refused.returncode == 2
    assert complaint in error
    assert complaint in json.loads(answer)["detail"]


def test_an_address_in_use_is_a_device_fault():
    first = start("--json")
    address = json.loads(first.stdout.readline())["address"]
    second = start("--address", address)
    _, error = second.communicate(timeout=30)
    first.kill()
    first.communicate()
    assert second.returncode == 3
    assert address in error
