"""How a calibration is laid out in the viewer: pictures and space left, figures and maps right."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from cell.core.geometry import Array
from cell.recording.calibration_moment import CalibrationMoment
from cell.recording.hole_scene import LASER, RING
from cell.recording.layout import CAMERA

WORLD, NOW, COVERAGE, LEANS = "/cell", "/now", "/coverage", "/leans"
PREDICTED, GOAL, FIGURES = "/uncertainty", "/uncertainty/goal", "/figures"
RESULTS = "/results"
NEAR = 0.85        # distance of the eye, in extents of what is looked at
IN_FRONT = 250.0   # mm
LEAN_SHOWN = 40.0  # degrees, each way
DARK = [24, 26, 30]


def build_calibration_blueprint(moment: CalibrationMoment) -> rrb.Blueprint:
    """Lay out the views for a session, as far as it is known what there is to look at."""
    seen = rrb.Tabs(_results(moment), _seen(moment)) if moment.results else _seen(moment)
    return rrb.Blueprint(
        rrb.Horizontal(seen, _said(moment), column_shares=[5, 4]),
        rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline="look", play_state="following"),
        auto_layout=False, auto_views=False)


def _seen(moment: CalibrationMoment) -> rrb.Vertical:
    width, height = moment.camera.image_size
    frame = rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height))
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Spatial2DView(origin=RING, name="ring light: corners of the board",
                              visual_bounds=frame),
            rrb.Spatial2DView(origin=LASER, name="laser: the stripe", visual_bounds=frame)),
        rrb.Spatial3DView(
            origin="/", contents=[f"{WORLD}/**", CAMERA, RING],
            name="views: grey planned, blue kept apart, yellow next, green taken",
            eye_controls=_eye(moment), background=DARK, line_grid=rrb.LineGrid3D(visible=False)),
        row_shares=[2, 3], name="views")


def _results(moment: CalibrationMoment) -> rrb.Grid:
    return rrb.Grid(*[rrb.Spatial2DView(origin=f"{RESULTS}/{number}", name=title)
                      for number, (title, _) in enumerate(moment.results)],
                    grid_columns=2, name="result")


def _said(moment: CalibrationMoment) -> rrb.Vertical:
    width, height = (0.25 * size for size in moment.camera.image_size)
    leans = (-LEAN_SHOWN, LEAN_SHOWN)
    top = 0.25 if np.isnan(moment.goal) else 3.0 * moment.goal
    return rrb.Vertical(
        rrb.TextDocumentView(origin=NOW, name="now"),
        rrb.Tabs(
            rrb.TimeSeriesView(origin=PREDICTED, name="predicted uncertainty, falling to its goal",
                               axis_y=rrb.ScalarAxis(range=(0.0, top)),
                               plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop)),
            rrb.TimeSeriesView(origin=FIGURES, name="while jogging",
                               plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop)),
            active_tab=1 if np.isnan(moment.goal) else 0),
        rrb.Horizontal(
            rrb.Spatial2DView(origin=COVERAGE, name="coverage: red is not seen yet",
                              visual_bounds=rrb.VisualBounds2D(x_range=(0, width),
                                                               y_range=(0, height))),
            rrb.Spatial2DView(origin=LEANS, name="lean, and roll (strokes)",
                              visual_bounds=rrb.VisualBounds2D(x_range=leans, y_range=leans))),
        row_shares=[5, 3, 4])


def _eye(moment: CalibrationMoment) -> rrb.EyeControls3D | None:
    """Look across the boards, at them and the views of the plan."""
    if not moment.boards:
        return None
    corners = np.vstack(moment.boards)
    cameras = [view.base_from_camera.translation for view in moment.planned]
    seen = np.vstack([corners, *(cameras or [_above(moment.boards[0])])])
    middle, size = (seen.min(axis=0) + seen.max(axis=0)) / 2.0, np.ptp(seen, axis=0)
    along = np.cross(seen[len(corners):].mean(axis=0) - corners.mean(axis=0), [0.0, 0.0, 1.0])
    aside = along / max(float(np.linalg.norm(along)), 1e-9)
    away = NEAR * float(np.linalg.norm(size))
    return rrb.EyeControls3D(position=middle + away * (aside + np.array([0.0, 0.0, 0.4])),
                             look_target=middle, eye_up=(0.0, 0.0, 1.0))


def _above(outline: Array) -> Array:
    """A point (3,) in front of a board, about where a camera will be."""
    away = np.cross(outline[3] - outline[0], outline[1] - outline[0])
    return np.asarray(outline.mean(axis=0) + IN_FRONT * away / np.linalg.norm(away))
