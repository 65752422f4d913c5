"""What `cell run` does when something is wrong: one clear message, the right code, nothing lost."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cell.core.errors import DeviceError, DocumentError
from cell.programs.check import check_job
from cell.programs.inspection import BodyInspection, prepare
from cell.programs.inspection.look import look
from cell.programs.run import Request, begin, measure, run_job
from cell.programs.shift.run import ShiftRequest, run_shift
from cell.programs.station import open_station
from cell.recording import Recorder, read
from cell.recording.keys import new_key
from cell.sim.controller.process import EmulatedController

HOME_DEG = [137.939, -109.974, 123.23, 1.512, 47.073, 157.747]


@pytest.fixture
def plant(cell_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder of its own, to spoil."""
    for name in ("jobs", "calibration"):
        shutil.copytree(cell_folder / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def cell_run(folder: Path, *words: str, most_bytes: int | None = None
             ) -> subprocess.CompletedProcess[str]:
    def limit() -> None:
        if most_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))

    return subprocess.run([sys.executable, "-m", "cell", "run", "jobs/demo.yaml", "--json", *words],
                          cwd=folder, text=True, capture_output=True, timeout=150, check=False,
                          preexec_fn=limit)


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def refusal(done: subprocess.CompletedProcess[str], code: int) -> str:
    assert done.returncode == code, done.stderr
    answer = json.loads(done.stdout)
    assert answer["ok"] is False
    assert "Traceback" not in done.stderr
    return answer["detail"]


def test_logs_that_is_a_file_is_refused_before_anything_moves(plant: Path) -> None:
    (plant / "logs").write_text("not a folder")
    assert "logs" in refusal(cell_run(plant), 2)


def test_options_of_simulated_cells_are_refused_for_real_ones(plant: Path) -> None:
    change(plant / "calibration/demo/cell.yaml", "driver: sim\n  model: ur10e",
           "driver: ur\n  address: 127.3.2.1\n  model: ur10e")
    assert "--speed" in refusal(cell_run(plant, "--speed", "2"), 2)


def test_no_robot_at_the_address_is_a_device_fault(plant: Path) -> None:
    change(plant / "calibration/demo/cell.yaml", "driver: sim\n  model: ur10e",
           "driver: ur\n  address: 127.3.2.1\n  model: ur10e")
    assert "127.3.2.1" in refusal(cell_run(plant), 3)
    assert not list((plant / "logs").glob("*.rrd"))


def test_a_camera_of_another_size_is_a_device_fault_before_anything_moves(plant: Path) -> None:
    change(plant / "calibration/demo/scene.yaml", "image_size: [768, 576]",
           "image_size: [640, 480]")
    assert "640 x 480" in refusal(cell_run(plant), 3)
    assert not list((plant / "logs").glob("*.rrd"))


def test_a_robot_in_local_mode_is_a_device_fault_that_says_what_to_do(plant: Path) -> None:
    with EmulatedController("ur10e") as controller:
        controller.tell_referee("local_mode on")
        change(plant / "calibration/demo/cell.yaml", "driver: sim\n  model: ur10e",
               f"driver: ur\n  address: {controller.address}\n  model: ur10e")
        assert "remote" in refusal(cell_run(plant), 3).lower()


def test_a_calibration_of_another_robot_is_refused_before_anything_moves(plant: Path) -> None:
    hand_eye = next((plant / "calibration/demo/sets").glob("*/hand_eye.yaml"))
    for manifest in hand_eye.parent.glob("set.yaml"):
        manifest.unlink()
    change(plant / "calibration/demo/cell.yaml", '  serial: "20235500417"\n', "")
    hand_eye.chmod(0o644)
    change(hand_eye, '"20235500417"', '"20199999999"')
    assert "20199999999" in refusal(cell_run(plant), 2)
    assert not list((plant / "logs").glob("*.rrd"))


def test_a_disk_that_fills_ends_the_run_with_4_and_keeps_the_whole_holes(plant: Path) -> None:
    done = cell_run(plant, "--speed", "10", most_bytes=3_000_000)
    refusal(done, 4)
    (log,) = (plant / "logs").glob("*.rrd")
    assert 1 <= len(read(log).holes) < 24


@pytest.mark.parametrize(("fault", "words"), [("wrong_size", "768 x 576"), ("lost", "camera")])
def test_a_camera_that_fails_stops_the_run_and_the_recording_says_so(
        plant: Path, fault: str, words: str) -> None:
    prepared, log = prepare(Path("jobs/demo.yaml")), plant / "body.rrd"
    with open_station(prepared.papers.station, prepared.folder, speed=10.0) as station:
        start = begin(prepared, station, "body", log.stem)
        inspection = BodyInspection(station, prepared, start, Recorder(log, start),
                                    lambda *_: None)
        station.world.set_fault(fault)
        with pytest.raises(DeviceError, match=words):
            measure(inspection)
    assert read(log).status == "fault"


def test_a_camera_that_hangs_darkens_the_laser_after_the_time_out_of_its_cell(
        plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with EmulatedController("ur10e", joints=np.radians(HOME_DEG)) as controller:
        change(plant / "calibration/demo/cell.yaml", "driver: sim\n  model: ur10e",
               f"driver: ur\n  address: {controller.address}\n  model: ur10e")
        change(plant / "calibration/demo/cell.yaml", "scene: scene.yaml",
               "scene: scene.yaml\n  timeout_s: 0.75")
        prepared = prepare(Path("jobs/demo.yaml"))
        with open_station(prepared.papers.station, prepared.folder) as station:
            switch = station.lights.set

            def switch_and_hang(light: str) -> None:
                switch(light)
                if light == "laser":
                    os.kill(station.world._process.pid, signal.SIGSTOP)

            monkeypatch.setattr(station.lights, "set", switch_and_hang)
            with pytest.raises(DeviceError, match=r"no answer within 0\.75 s"):
                look(station, {"ring": 0.008, "laser": 0.004}, 0)
            assert json.loads(controller.tell_referee("truth"))["outputs"] == 0


def test_a_protective_stop_ends_the_run_with_the_arm_at_rest_and_the_laser_off(
        plant: Path) -> None:
    with EmulatedController("ur10e", speed=5.0,
                            joints=[q * 3.141592653589793 / 180 for q in HOME_DEG]) as controller:
        change(plant / "calibration/demo/cell.yaml", "driver: sim\n  model: ur10e",
               f"driver: ur\n  address: {controller.address}\n  model: ur10e")

        def watch(done: int, _total: int, _words: str) -> None:
            if done == 2:
                controller.tell_referee("protective_stop")

        with pytest.raises(DeviceError, match="protective") as stopped:
            run_job(Request(Path("jobs/demo.yaml")), watch)
        truth = json.loads(controller.tell_referee("truth"))
    assert truth["outputs"] == 0
    assert max(map(abs, truth["joint_speeds"])) < 1e-3
    (log,) = (plant / "logs").glob("*.rrd")
    assert read(log).status == "fault"
    assert log.name in stopped.value.__notes__[0]
    assert "protective stop" in log.with_suffix(".html").read_text()


@pytest.mark.parametrize("words", [{"truth": Path("jobs")}, {"truth": Path("none/truth.json")},
                                   {"body_id": ""}, {"body_id": "two\nlines"}])
def test_what_could_not_be_kept_is_refused_before_the_cell_is_opened(plant: Path,
                                                                     words: dict) -> None:
    with pytest.raises(DocumentError):
        run_job(Request(Path("jobs/demo.yaml"), **words), pytest.fail)
    assert not (plant / "logs").exists()


@pytest.fixture(params=["cell run", "cell shift", "cell check"])
def begun(request: pytest.FixtureRequest) -> Callable[[], object]:
    """The programs that record, up to where they would open the cell, or that foretell it."""
    return {"cell run": lambda: run_job(Request(Path("jobs/demo.yaml")), pytest.fail),
            "cell shift": lambda: run_shift(ShiftRequest(Path("jobs/demo_shift.yaml")),
                                            pytest.fail, pytest.fail),
            "cell check": lambda: check_job(Path("jobs/demo.yaml"))}[request.param]


def test_a_disk_that_is_nearly_full_is_refused_before_the_cell_is_opened(
        plant: Path, begun: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(plant)._replace(free=150_000_000)
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    monkeypatch.setattr(subprocess, "Popen", pytest.fail)  # no device, no simulator
    with pytest.raises(DocumentError, match="150 MB are free on its disk; 200 MB are needed"):
        begun()
    assert list((plant / "logs").iterdir()) == []


def test_a_key_that_others_can_read_is_refused_before_the_cell_is_opened(
        plant: Path, begun: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    new_key(plant / "seal.key")
    (plant / "seal.key").chmod(0o644)
    monkeypatch.setenv("CELL_SEAL_KEY", str(plant / "seal.key"))
    monkeypatch.setattr(subprocess, "Popen", pytest.fail)
    with pytest.raises(DocumentError, match="others can use this key"):
        begun()
    assert list((plant / "logs").iterdir()) == []


