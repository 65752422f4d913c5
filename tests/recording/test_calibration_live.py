"""The live picture of a calibration: every moment is whole, and no viewer can hold a session up."""

import signal
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rerun as rr
from made_scenes import camera_over, demo_world

from cell.recording import layout
from cell.recording.calibration_moment import CalibrationMoment, Line, Picture, PlannedView
from cell.recording.calibration_scene import CalibrationScene, describe, map_coverage
from cell.recording.live import WAITING, LiveView
from cell.recording.rows import open_chunks
from cell.recording.viewer import free_port, viewer_process

CAMERA = demo_world().sensor.camera
IMAGE = np.full((576, 768), 90, np.uint8)
BOARD = np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [60.0, 45.0, 0.0], [0.0, 45.0, 0.0]])


@pytest.fixture
def moment():
    corners = np.array([[10.0, 20.0], [700.0, 500.0], [380.0, 290.0]])
    views = (PlannedView(1, camera_over(30.0, 20.0), apart=False, state="taken"),
             PlannedView(2, camera_over(20.0, 20.0, tilt_deg=(20.0, 5.0)), apart=True))
    return CalibrationMoment(
        "a session", "all, cell demo", CAMERA, look=7, step="view 01 of 02",
        lines=(Line("exposure", "ok", "ok", good=True), Line("views", "3", ">= 15", good=False)),
        ring=Picture(IMAGE, corners), laser=Picture(IMAGE, np.zeros((0, 2))),
        base_from_camera=camera_over(30.0, 20.0), boards=(BOARD,),
        sphere=(np.array([90.0, 0.0, 10.0]), 10.0), planned=views, corners=corners,
        leans=np.array([[20.0, -5.0, 30.0]]), figures=(("tilt (deg)", 20.0),),
        predicted=0.081, goal=0.06)


def draw(path, *moments):
    stream = rr.RecordingStream(layout.APPLICATION, recording_id="live")
    stream.set_sinks(rr.FileSink(str(path)))
    scene = CalibrationScene(stream, moments[0])
    for moment in moments:
        scene.draw(moment)
    stream.disconnect()


def drawn(log, path, component):
    with open_chunks(log) as chunks:
        return [value.as_py() for chunk in chunks if chunk.entity_path == path
                for batch in [chunk.to_record_batch()] if component in batch.schema.names
               for value in batch.column(component)]


def test_a_moment_shows_what_was_found_and_how_far_it_has_come(tmp_path, moment):
    draw(tmp_path / "a.rrd", replace(moment, ring=None, planned=(), boards=()), moment)
    found = drawn(tmp_path / "a.rrd", "/camera/ring/found", "Points2D:positions")[-1]
    np.testing.assert_allclose(found, moment.corners)
    assert drawn(tmp_path / "a.rrd", "/uncertainty", "Scalars:scalars")[-1] == [0.081]
    assert drawn(tmp_path / "a.rrd", "/uncertainty/goal", "Scalars:scalars")[-1] == [0.06]
    labels = drawn(tmp_path / "a.rrd", "/cell/numbers", "Points3D:labels")[-1]
    assert labels == ["1", "2"]


def test_the_pictures_of_the_report_are_shown_with_the_verdict(tmp_path, moment):
    _, png = cv2.imencode(".png", IMAGE)
    results = (("Sphere", png.tobytes()), ("Residuals", png.tobytes()))
    draw(tmp_path / "a.rrd", moment, replace(moment, results=results))
    for number in (0, 1):
        shown, = drawn(tmp_path / "a.rrd", f"/results/{number}", "EncodedImage:blob")[-1]
        assert bytes(shown) == png.tobytes()


def test_the_panel_says_first_what_is_missing(moment):
    text = describe(moment)
    assert text.index("| views |") < text.index("| exposure |")
    assert "view 01 of 02" in text and "**0.081 mm**, goal 0.060" in text


def test_the_coverage_map_marks_the_cells_that_saw_corners(moment):
    picture = map_coverage(moment.corners, CAMERA.image_size)
    seen = picture[..., 1] > picture[..., 0]  # green
    assert seen.mean() == pytest.approx(3 / 64)
    assert seen[0, 0] and seen[500 // 4, 700 // 4] and not seen[-1, 0]


@pytest.mark.parametrize("how", ["absent", "hung", "killed"])
def test_no_viewer_holds_a_session_up(moment, how):
    port = free_port()
    with viewer_process("--serve-grpc", "--port", str(port if how == "hung" else free_port())
                        ) as hub, LiveView(port) as live:
        time.sleep(0.5)
        if how == "hung":
            hub.send_signal(signal.SIGSTOP)
        if how == "killed":
            live._drawer.kill()
        for look in range(200):
            live.show(replace(moment, look=look))
            assert len(live._waiting) <= WAITING
        hub.send_signal(signal.SIGCONT)
