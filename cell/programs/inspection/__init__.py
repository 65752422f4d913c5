"""The main job: drive round a body, measure every hole, judge, record."""

from cell.programs.inspection.body import BodyInspection, Watch
from cell.programs.inspection.prepare import Prepared, prepare

__all__ = ["BodyInspection", "Prepared", "Watch", "prepare"]
