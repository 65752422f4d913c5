"""A shift on the demo's virtual cell, with a short job and a hand on its faults."""

import json
import socket

from made_workplace import Workplace

from cell.sim.controller.referee import PORT as REFEREE_PORT

ADDRESS = "127.83.61.{}"

SHORT_JOB = """\
name: demo
cell: demo
nominals: demo.csv
stops:
{stops}"""

SHIFT = """\
name: short
cell: demo
bodies:
  - {{type: 1, job: demo.yaml}}
{more}line: {{port: 0, patience_s: 10.0}}
simulation: {{repair_s: 0.5}}
"""


class Cause:
    """Causes faults at the emulated controller, once each, when a board shows the moment."""

    def __init__(self, address, moments):
        self.address, self.moments, self.struck = address, dict(moments), []

    def show(self, board):
        moment = (board.body_id, board.hole)
        if board.state == "measuring" and moment in self.moments:
            fault = self.moments.pop(moment)
            self.struck.append(fault)
            fault() if callable(fault) else self.tell(fault)

    def truth(self):
        return json.loads(self._ask("truth"))

    def tell(self, command):
        assert self._ask(command) == "ok"

    def _ask(self, command):
        with socket.create_connection((self.address, REFEREE_PORT), timeout=5.0) as link:
            link.sendall(command.encode() + b"\n")
            with link.makefile() as answers:
                return answers.readline().strip()


def short_shift(folder, number, holes=("BP5", "BP1", "BP3"), more=""):
    """Write a shift of a short job, at a controller address of its own."""
    place = Workplace.in_folder(folder)
    place.job.write_text(SHORT_JOB.format(
        stops="".join(f"  - {{hole: {hole}}}\n" for hole in holes)))
    place.replace(place.cell / "cell.yaml", "driver: sim", f"driver: sim\n  address: "
                  f"{ADDRESS.format(number)}")
    shift = place.folder / "jobs" / "short.yaml"
    shift.write_text(SHIFT.format(more=more))
    return place, shift, ADDRESS.format(number)
