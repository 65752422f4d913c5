"""How a recording opens in the viewer: the hole, the body, the deviations, the verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb

from cell.core.documents.nominals import Hole
from cell.core.documents.papers import Papers
from cell.recording import layout
from cell.recording.body_scene import EXAGGERATION, PLOT, TABLE
from cell.recording.hole_scene import LASER, RING, VERDICT


def build_blueprint(papers: Papers, following: bool = False, at: int | None = None
                    ) -> rrb.Blueprint:
    """Lay out the views for a body.

    Args:
        papers: those of the run: they say how large an image is, and from where to look.
        following: stay with the newest hole (live); else wait at the first, or
        at: wait at this place of the time line.
    """
    return rrb.Blueprint(
        rrb.Horizontal(_seen(papers), _said(), column_shares=[3, 2]),
        rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
        _time_panel(following, at), auto_layout=False, auto_views=False)


def _time_panel(following: bool, at: int | None) -> rrb.TimePanel:
    """A layout cannot say where the time line stands; that it plays one place over and over, it
    can. A click on another place ends it.
    """
    if at is None:
        return rrb.TimePanel(state="collapsed", timeline=layout.HOLE_TIMELINE,
                             play_state="following" if following else "paused")
    return rrb.TimePanel(state="collapsed", timeline=layout.HOLE_TIMELINE, play_state="playing",
                         loop_mode="selection",
                         time_selection=rrb.components.AbsoluteTimeRange(at, at))


def _seen(papers: Papers) -> rrb.Vertical:
    width, height = papers.calibration.sensor.image_size
    frame = rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height))
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Spatial2DView(origin=RING, name="ring light: edge points, ellipse, centre",
                              visual_bounds=frame),
            rrb.Spatial2DView(origin=LASER, name="laser: stripe, A, B and their middle Q",
                              visual_bounds=frame)),
        rrb.Spatial3DView(origin="/", contents=["/body/**", layout.CAMERA, RING],
                          name=f"the body: verdicts, deviations {EXAGGERATION:.0f} times as long",
                          eye_controls=_eye(papers.planned_holes), background=[24, 26, 30],
                          line_grid=rrb.LineGrid3D(visible=False)),
        row_shares=[2, 3])


def _said() -> rrb.Vertical:
    return rrb.Vertical(
        rrb.Tabs(rrb.TextDocumentView(origin=VERDICT, name="this hole"),
                 rrb.TextDocumentView(origin=TABLE, name="the body")),
        rrb.TimeSeriesView(origin=PLOT, name="deviation as share of its tolerance, hole by hole",
                           plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop)),
        rrb.StateTimelineView(origin=VERDICT, name="verdicts"),
        row_shares=[5, 4, 1.4])


def _eye(holes: Sequence[Hole]) -> rrb.EyeControls3D:
    """Look at the middle of the holes, from the side where the camera stands."""
    centres = np.array([hole.centre for hole in holes])
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2.0
    size = float(np.linalg.norm(np.ptp(centres, axis=0))) + 300.0
    towards = np.sum([hole.normal_to_camera for hole in holes], axis=0)
    towards = towards / max(float(np.linalg.norm(towards)), 1e-9)
    return rrb.EyeControls3D(position=middle + 0.68 * size * towards, look_target=middle,
                             eye_up=(0.0, 0.0, 1.0))
