"""The picture: what is drawn follows from the papers, the viewer has no complaints, and a live view
that hangs, dies or is not there costs the file nothing.
"""

import json
import signal
import socket
import subprocess
import time

import numpy as np
import pytest
import rerun as rr
from recorded_body import measured_anew, record_body
from rerun.chunk import LazyChunkStream

from cell.core.errors import DeviceError, DocumentError
from cell.recording import Recorder, read
from cell.recording.live import LiveView
from cell.recording.replay import connect, draw, photograph, replay, survey
from cell.recording.rows import open_chunks
from cell.recording.viewer import free_port, hub_url, viewer_process


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CELL_SEAL_KEY", "/nowhere/seal.key")
        return record_body(tmp_path_factory.mktemp("logs") / "body.rrd")


def drawn(log, path, component):
    with open_chunks(log) as chunks:
        return [value.as_py() for chunk in chunks if chunk.entity_path == path
                for batch in [chunk.to_record_batch()] if component in batch.schema.names
               for value in batch.column(component)]


def test_every_hole_is_drawn_with_what_was_found_in_it(log):
    holes = read(log).holes
    rims = drawn(log, "/camera/ring/found", "Points2D:positions")
    for hole, rim in zip(holes, rims, strict=True):
        np.testing.assert_allclose(rim, hole.outcome.located.trace["rim"], atol=1e-3)
    points = drawn(log, "/camera/laser/points", "Points2D:positions")
    assert [len(each) for each in points] == [3, 3, 3]  # A, B and Q


def test_the_numbers_beside_it_are_those_of_the_judgement(log):
    result = read(log).stop.result
    for feature, text in zip(result.features, drawn(log, "/verdict", "TextDocument:text"),
                             strict=True):
        assert f"{feature.measured['d']:.3f}" in text[0]
        assert f"{feature.deviation['d']:+.3f}" in text[0]
    shares = drawn(log, "/deviation", "Scalars:scalars")
    assert shares[1][3] == pytest.approx(result.features[1].deviation["d"]
                                         / result.features[1].tolerance["d"])


def test_a_hole_is_found_by_its_name(log):
    found = survey(log)
    assert [found.find(name) for name in ("BP2", "SI3", "QP2")] == [0, 1, 2]
    with pytest.raises(DocumentError, match="holds no hole 'XX'; it holds BP2, SI3, QP2"):
        found.find("XX")


def test_the_viewer_shows_it_without_complaints(log):
    try:
        picture = photograph(log, 1)
    except (DeviceError, ConnectionError) as error:
        pytest.skip(f"no headless viewer can run here: {error}")
    assert picture.complaints == ()
    assert picture.png.startswith(b"\x89PNG")
    assert len(picture.png) > 50_000


def test_the_layout_lets_the_viewer_stand_at_a_hole(log):
    """A browser cannot be told where to stand: the layout must."""
    try:
        with viewer_process("--headless", "--port", str(port := free_port())):
            viewer = connect(port)
            replay(log, hub_url(port), open_at=2)
            deadline = time.monotonic() + 30.0
            while time.monotonic() < deadline and standing(viewer) != [2]:
                time.sleep(0.2)
            assert standing(viewer) == [2]
    except DeviceError as error:
        pytest.skip(f"no headless viewer can run here: {error}")


def standing(viewer):
    return [recording.current_time for recording in viewer.get_state().recordings]


def test_what_is_shown_does_not_come_from_the_picture_in_the_file(log, tmp_path):
    """Whoever repaints the picture in a file, `cell view` shows the audited numbers."""
    with open_chunks(log) as chunks:
        kept = [chunk for chunk in chunks if not chunk.entity_path.startswith("/verdict")]
    bare = tmp_path / "bare.rrd"
    LazyChunkStream.from_iter(iter(kept)).write_rrd(str(bare), application_id="cell",
                                                    recording_id="body")
    assert drawn(bare, "/verdict", "TextDocument:text") == []
    shown = tmp_path / "shown.rrd"
    stream = rr.RecordingStream("cell", recording_id="body")
    stream.set_sinks(rr.FileSink(shown))
    draw(bare, stream)
    stream.disconnect()
    assert drawn(shown, "/verdict", "TextDocument:text") == drawn(log, "/verdict",
                                                                  "TextDocument:text")


@pytest.mark.parametrize("how", ["absent", "hung"])
def test_a_live_view_that_does_not_answer_costs_the_file_nothing(tmp_path, how):
    start, holes = measured_anew()
    port = free_port()
    with viewer_process("--serve-grpc", "--port", str(port if how == "hung" else free_port())
                        ) as hub, LiveView(port) as live:
        time.sleep(0.5)
        hub.send_signal(signal.SIGSTOP)
        recorder = Recorder(tmp_path / "a.rrd", start, live)
        for _ in range(5):
            for hole in holes:
                recorder.write_hole(hole)
        recorder.finish(stop_of(tmp_path))
        hub.send_signal(signal.SIGCONT)
    assert len(read(tmp_path / "a.rrd").holes) == 15


def test_a_live_view_whose_process_is_killed_costs_the_file_nothing(tmp_path):
    start, holes = measured_anew()
    with LiveView(free_port()) as live:
        recorder = Recorder(tmp_path / "a.rrd", start, live)
        recorder.write_hole(holes[0])
        live._drawer.kill()
        for hole in holes[1:]:
            recorder.write_hole(hole)
        recorder.finish(stop_of(tmp_path))
    assert len(read(tmp_path / "a.rrd").holes) == 3


def test_no_port_of_the_viewer_is_open_to_others():
    port = free_port()
    with viewer_process("--serve-grpc", "--port", str(port)):
        for _ in range(100):
            listening = subprocess.run(["ss", "-ltn"], capture_output=True, text=True,
                                       check=False).stdout
            if f":{port} " in listening:
                break
            time.sleep(0.1)
    if f":{port} " not in listening:
        pytest.skip("`ss` does not show the viewer's port here")
    assert f"127.0.0.1:{port} " in listening
    assert f"0.0.0.0:{port} " not in listening


def test_the_viewer_sends_no_usage_data(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    port = free_port()
    with viewer_process("--serve-grpc", "--port", str(port)):
        for _ in range(100):
            with socket.socket() as trial:
                if trial.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        (settings,) = tmp_path.glob("*/rerun/analytics.json")
        assert json.loads(settings.read_text())["analytics_enabled"] is False


def stop_of(folder):
    return read(record_body(folder / "other.rrd", holes=())).stop
