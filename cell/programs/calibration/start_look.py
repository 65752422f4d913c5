"""One look while the operator jogs: what is seen of the board, in figures to jog by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.errors import UnmeasurableError
from cell.core.observation import View
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardPose, locate_boards
from cell.metrology.calibrate.detect_board import BoardDesign, SeenBoard, detect_board
from cell.recording.calibration_moment import Line


@dataclass(frozen=True, eq=False)
class StartLook:
    """A picture under the ring light; without a board, `trouble` says what to do.

    `wanted` are the nearest and the farthest distance (mm) that views are planned at.
    """

    view: View
    corners: int
    wanted: tuple[float, float]
    seen: SeenBoard | None = None
    pose: BoardPose | None = None
    trouble: str = ""

    def __str__(self) -> str:
        if self.seen is None or self.pose is None:
            return self.trouble
        cut = f"   cut off: {', '.join(self.seen.cut_off)}" if self.seen.cut_off else ""
        return (f"corners {len(self.seen.view.pixels)}/{self.corners}   sharp "
                f"{self.seen.sharpness:.2f}   exposure {self.seen.exposure}   tilt "
                f"{np.degrees(self.pose.tilt):.0f} deg   distance {self.distance:.0f} mm{cut}")

    @property
    def distance(self) -> float:
        """How far (mm) the board's first corner is along the optic axis; NaN without a board."""
        return float("nan") if self.pose is None \
            else float(self.pose.camera_from_board.translation[2])

    @property
    def figures(self) -> dict[str, float]:
        """The figures by name, as they are drawn over time; empty without a board."""
        if self.seen is None or self.pose is None:
            return {}
        return {"corners (%)": 100.0 * len(self.seen.view.pixels) / self.corners,
                "sharpness (% / px)": 100.0 * self.seen.sharpness,
                "tilt (deg)": float(np.degrees(self.pose.tilt)),
                "distance off (mm)": self.distance - float(np.mean(self.wanted))}

    @property
    def lines(self) -> tuple[Line, ...]:
        """The figures, each with what is wanted of it."""
        if self.seen is None or self.pose is None:
            return (Line("board", "not seen", self.trouble, good=False),)
        cut = ", ".join(self.seen.cut_off)
        return (Line("corners", f"{len(self.seen.view.pixels)} of {self.corners}",
                     f"cut off: {cut}" if cut else "all or most"),
                Line("sharpness", f"{self.seen.sharpness:.2f}", "some 0.3 to 0.4 in focus"),
                Line("exposure", self.seen.exposure, "ok", good=self.seen.exposure == "ok"),
                Line("tilt", f"{np.degrees(self.pose.tilt):.0f} deg", "about straight"),
                Line("distance", f"{self.distance:.0f} mm",
                     f"{self.wanted[0]:.0f} to {self.wanted[1]:.0f} mm",
                     good=self.wanted[0] <= self.distance <= self.wanted[1]))


def look_at_board(view: View, design: BoardDesign, camera: CameraModel,
                  wanted: tuple[float, float]) -> StartLook:
    """See what a picture shows of a board."""
    try:
        seen = detect_board(view.image, design)
        pose = locate_boards([seen.view], camera)[0]
    except UnmeasurableError as error:
        return StartLook(view, design.corners, wanted, trouble=error.detail)
    return StartLook(view, design.corners, wanted, seen, pose)
