"""The controller's ports and its cycle, in one thread that sleeps between the cycles."""

from __future__ import annotations

import selectors
import socket
import time
from collections.abc import Callable

from cell.sim.controller.connection import Connection, lines
from cell.sim.controller.controller import Controller, RobotMode, Runtime, Safety
from cell.sim.controller.dashboard import GREETING, Dashboard
from cell.sim.controller.primary import kinematics_message
from cell.sim.controller.program import ControlProgram
from cell.sim.controller.referee import PORT as REFEREE_PORT
from cell.sim.controller.referee import Referee
from cell.sim.controller.rtde import RtdeSession, Values, outputs_of

PRIMARY, SCRIPT, RTDE, DASHBOARD = 30001, 30003, 30004, 29999
UPLOAD_DELAY = 0.08  # s from the end of an upload to the running program
OUTPUT_GROUPS = {"standard_digital_output": 0, "configurable_digital_output": 8,
                 "tool_digital_output": 16}  # the first bit of each in the outputs' word
IDLE_PERIOD = 0.05   # s between cycles while no client listens and nothing moves


class Server:
    """A controller at an address. `run` serves until `alive` says no."""

    def __init__(self, controller: Controller, address: str, rate: float = 125.0) -> None:
        self.address = address
        self._period = 1.0 / rate
        self._rate = rate
        self._selector = selectors.DefaultSelector()
        self._sessions: dict[Connection, RtdeSession] = {}
        self._clients: set[Connection] = set()
        self._taken: set[str] = set()
        self._now = time.monotonic()
        self.restart(controller)
        self._listen()

    def restart(self, controller: Controller) -> None:
        """Begin anew with a controller that knows nothing of what was before."""
        self.cut()
        controller.wall = self._now
        self._silence = 0.0
        self.controller = controller
        self.faults: set[str] = set()
        self.uploads = 0
        self._registers: Values = {}
        self._last: Values = {}
        self._program: ControlProgram | None = None
        self._starting: float | None = None
        self._dashboard, self._referee = Dashboard(controller), Referee(self)

    # --- the ports --------------------------------------------------------------------------------

    def _listen(self) -> None:
        greeters: dict[int, Callable[[Connection], None]] = {
            PRIMARY: self._greet_primary, SCRIPT: self._greet_script, RTDE: self._greet_rtde,
            DASHBOARD: self._greet_dashboard, REFEREE_PORT: self._greet_referee}
        for port, greet in greeters.items():
            listener = socket.create_server((self.address, port), backlog=16)
            listener.setblocking(False)
            self._selector.register(listener, selectors.EVENT_READ, greet)

    def _accept(self, listener: socket.socket, greet: Callable[[Connection], None]) -> None:
        try:
            link, _ = listener.accept()
        except OSError:
            return
        connection = Connection(link)
        self._selector.register(link, selectors.EVENT_READ, connection)
        if greet != self._greet_referee:
            self._clients.add(connection)
        greet(connection)

    def _greet_rtde(self, connection: Connection) -> None:
        session = RtdeSession(connection.send, self._write, self._taken, self._rate)
        self._sessions[connection] = session
        connection.receive, connection.closed = session.receive, session.close

    def _greet_dashboard(self, connection: Connection) -> None:
        connection.receive = lines(self._dashboard.answer, connection)
        connection.send((GREETING + "\n").encode())

    def _greet_referee(self, connection: Connection) -> None:
        connection.receive = lines(self._referee.answer, connection)

    def _greet_primary(self, connection: Connection) -> None:
        connection.send(kinematics_message(self.controller.arm))

    def _greet_script(self, connection: Connection) -> None:
        received = bytearray()

        def receive(data: bytes) -> None:
            received.extend(data)
            if b"\nend\n" in received or received.endswith(b"\nend") or b"def" not in received:
                self._upload(bytes(received))
                received.clear()

        connection.receive = receive

    # --- the cycle --------------------------------------------------------------------------------

    def run(self, alive: Callable[[], bool]) -> None:
        """Serve the ports and drive the controller, until `alive` answers no."""
        due = time.monotonic()
        while alive():
            self._serve(max(0.0, due - time.monotonic()))
            if time.monotonic() >= due:
                self._cycle()
                busy = self._sessions or self.controller.moving or self._starting
                due = max(due + (self._period if busy else IDLE_PERIOD), time.monotonic())

    def _serve(self, timeout: float) -> None:
        events = self._selector.select(timeout)
        self._now = time.monotonic()
        for key, _ in events:
            if isinstance(key.data, Connection):
                self._read(key.data)
            else:
                self._accept(key.fileobj, key.data)  # type: ignore[arg-type]

    def _read(self, connection: Connection) -> None:
        if "freeze" in self.faults and connection in self._clients:
            time.sleep(0.001)  # what is not read stays readable: do not spin on it
            return
        connection.read()
        self._drop_closed(connection)

    def _cycle(self) -> None:
        controller = self.controller
        # A time in which this process did not run, on a busy machine, is not the client's silence.
        self._silence += min(self._now - controller.wall, 2.0 * self._period)
        controller.advance(self._now)
        self._start_uploaded()
        if self._program is not None:
            self._program.step()
            if self._silence > self._program.silence_allowed and controller.playing:
                controller.end_program("the client's watchdog was not kicked")
            if controller.runtime is Runtime.STOPPED:
                self._program = None
        if self._sessions and not self.faults & {"freeze", "freeze_stream"}:
            self._publish()

    def _publish(self) -> None:
        if "stall" not in self.faults or not self._last:
            self._last = outputs_of(self.controller) | self._registers
        for connection, session in list(self._sessions.items()):
            session.cycle(self._now, self._last)
            self._drop_closed(connection)

    # --- what clients cause -----------------------------------------------------------------------

    def _write(self, values: Values) -> None:
        self._registers.update(values)
        for group, shift in OUTPUT_GROUPS.items():
            if f"{group}_mask" in values:
                mask, levels = (int(values[f"{group}{part}"]) << shift  # type: ignore[arg-type]
                                for part in ("_mask", ""))
                self.controller.set_outputs(mask, levels)
        if "input_int_register_0" in values:
            self._silence = 0.0
            if self._program is not None:
                self.controller.advance(self._now)
                self._program.step()

    def _upload(self, text: bytes) -> None:
        self.uploads += 1
        ready = (self.controller.remote_control and "refuse_upload" not in self.faults
                 and self.controller.robot_mode is RobotMode.RUNNING
                 and self.controller.safety in (Safety.NORMAL, Safety.REDUCED))
        if ready:
            self.controller.end_program()
            self._program = None
            self._starting = self._now + UPLOAD_DELAY if b"def rtde_control" in text else None

    def _start_uploaded(self) -> None:
        if self._starting is not None and self._now >= self._starting:
            self._starting = None
            self._program = ControlProgram(self.controller, self._registers)
            self.controller.play()

    # --- faults and endings -----------------------------------------------------------------------

    def broadcast(self, data: bytes) -> None:
        """Send bytes to every RTDE client in the middle of its stream."""
        for connection in list(self._sessions):
            connection.send(data)

    def cut(self) -> None:
        """End every client's connection; the referee's stay."""
        for connection in list(self._clients):
            connection.open = False
            self._drop_closed(connection)

    def _drop_closed(self, connection: Connection) -> None:
        if not connection.open:
            self._selector.unregister(connection.socket)
            self._sessions.pop(connection, None)
            self._clients.discard(connection)
            connection.close()
