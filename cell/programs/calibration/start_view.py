"""The start view: the operator jogs until the board fills the picture, by a live line of figures.

Only the ring light burns here: somebody may stand beside the arm.
"""

from __future__ import annotations

import time

from cell.core.documents.base import as_rows, as_six
from cell.core.documents.calibration_session import CalibrationPlan, PlacedBoard
from cell.core.documents.targets import BoardDocument
from cell.core.errors import DocumentError
from cell.core.ports import Operator
from cell.programs.calibration.belief import Belief, design_of
from cell.programs.calibration.capture import shoot_ring
from cell.programs.calibration.shown import Shown
from cell.programs.calibration.start_look import StartLook, look_at_board
from cell.programs.station import Station

LOOKS = 12       # questions before the wizard gives up
JOGGING_S = 300.0  # after which it asks again: nobody may be there to press a key
TAKE, AGAIN, JOG, QUIT = "take", "again", "jog", "quit"


class StartView:
    """Finds the start view of one board with the operator."""

    def __init__(self, board: BoardDocument, belief: Belief, plan: CalibrationPlan,
                 station: Station, operator: Operator, shown: Shown) -> None:
        self._board, self._belief, self._station = board, belief, station
        self._operator, self._shown = operator, shown
        middle = belief.sensor.working_distance
        self._wanted = middle - plan.depth_mm, middle + plan.depth_mm

    def find(self) -> PlacedBoard:
        """Look until the operator is content; say where the board is and where the arm stands.

        Raises:
            DeviceError: a device failed; the light is off.
            DocumentError: the operator quit, or no look was good.
        """
        self._shown.step("start view", "Jog until the board fills the picture, sharp, well lit and "
                         "about straight; then answer at the terminal.")
        look = self._look()
        for _ in range(LOOKS):
            self._operator.tell(str(look))
            answer = self._ask(look)
            if answer == TAKE:
                return self._placed(look)
            if answer == QUIT:
                raise DocumentError("stopped by the operator")
            look = self._jog() if answer == JOG else self._look()
        raise DocumentError(f"no good start view of the board {self._board.id}",
                            source=f"cell {self._belief.folder.name}")

    def _ask(self, look: StartLook) -> str:
        if look.seen is None:
            return self._operator.choose(f"The board {self._board.id} is not seen. Look again, jog "
                                         "with a live line, or quit?",
                                         (AGAIN, JOG, QUIT))
        return self._operator.choose(f"Does the board {self._board.id} fill the view, sharp and "
                                     "well lit? Take it, look again, jog with a live line, or "
                                     "quit?", (TAKE, AGAIN, JOG, QUIT))

    def _jog(self) -> StartLook:
        """Look again and again, until a key is pressed."""
        self._operator.tell("Jog now; the light stays on. Press any key when the board fills the "
                            "view.")
        until = time.monotonic() + JOGGING_S
        try:
            self._light_up()
            while True:
                look = self._expose()
                self._operator.glance(str(look))
                if self._operator.pressed() or time.monotonic() > until:
                    return look
        finally:
            self._station.lights.off()

    def _look(self) -> StartLook:
        try:
            self._light_up()
            return self._expose()
        finally:
            self._station.lights.off()

    def _light_up(self) -> None:
        """Switch the ring light on, and wait until it has risen and the arm has settled."""
        robot, now = self._station.document.robot, time.monotonic()
        self._station.lights.set("ring")
        self._station.pause(max(robot.settle_s, robot.light_rise_s), since=now)

    def _expose(self) -> StartLook:
        look = look_at_board(shoot_ring(self._station), design_of(self._board),
                             self._belief.sensor.camera, self._wanted)
        self._shown.looked(look)
        return look

    def _placed(self, look: StartLook) -> PlacedBoard:
        assert look.pose is not None
        place = (self._belief.chain.base_from_camera(look.view.base_from_flange_before,
                                                     look.view.joints)
                 @ look.pose.camera_from_board)
        return PlacedBoard(board=self._board, base_from_board=as_rows(place),
                           start=as_six(look.view.joints))
