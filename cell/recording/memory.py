"""Giving back what rerun holds: without this each body would cost three megabytes to the end.

rerun 0.41 keeps every stream of a process until it is swept away, and never lets go of the stream
that `send_blueprint` fills on its way unless that is disconnected by hand.
"""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings as bindings

from cell.recording import layout


def sweep_streams() -> None:
    """Let rerun forget the streams that nobody holds any more."""
    bindings.flush_and_cleanup_orphaned_recordings()


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> None:
    """Do what `stream.send_blueprint` does, and give its memory back."""
    passing = rr.RecordingStream._from_native(  # noqa: SLF001  as rerun itself does
        bindings.new_blueprint(application_id=layout.APPLICATION, make_default=False,
                               make_thread_default=False, default_enabled=True))
    passing.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(passing)  # noqa: SLF001
    stored = passing.memory_recording()
    bindings.send_blueprint(stored.storage, True, True, recording=stream.to_native())
    passing.disconnect()
