"""The body from three sides, with the deviation of every hole as an arrow: one SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.core.documents.nominals import Hole
from cell.core.documents.result import Feature

COLOURS = {"in_tolerance": "#2a9d5c", "out_of_tolerance": "#d1343c", "uncertain": "#d9901a",
           "not_measured": "#7a7f87"}
SIDES = (("x", "y", "from above"), ("x", "z", "from the side"), ("y", "z", "from the front"))
ARROW_SHARE = 0.1  # of the picture's width, for a typical arrow
TYPICAL, CAP = 80, 2.0  # percentile that sets the scale; longer arrows are cut at CAP times it


def draw_deviations(features: Sequence[Feature], holes: Sequence[Hole]) -> str:
    """Draw the holes in body coordinates (mm) with magnified deviations; return an SVG element."""
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    by_id = {hole.id: hole for hole in holes}
    for axes, (across, up, title) in zip(figure.subplots(1, 3), SIDES, strict=True):
        _draw_side(axes, features, by_id, (across, up))
        axes.set_title(title, fontsize=10)
    return _as_svg(figure)


def _draw_side(axes: Axes, features: Sequence[Feature], holes: dict[str, Hole],
               side: tuple[str, str]) -> None:
    at = np.array([_pick(holes[feature.id].centre, side) for feature in features])
    shift = np.array([[(feature.deviation or {}).get(axis, 0.0) for axis in side]
                      for feature in features])
    length = np.linalg.norm(shift, axis=1)
    typical = max(float(np.percentile(length, TYPICAL)), 1e-3)
    scale = ARROW_SHARE * float(np.ptp(at, axis=0).max()) / typical
    shift = shift * np.minimum(1.0, CAP * typical / np.maximum(length, 1e-9))[:, None]
    colours = [COLOURS[feature.verdict] for feature in features]
    axes.scatter(at[:, 0], at[:, 1], s=26, c=colours, zorder=3, edgecolors="white", linewidths=0.6)
    arrows = axes.quiver(at[:, 0], at[:, 1], shift[:, 0], shift[:, 1], color=colours,
                         angles="xy", scale_units="xy", scale=1.0 / scale, width=0.005, zorder=2)
    axes.update_datalim(at + scale * shift)  # or the longest arrow would leave the picture
    axes.quiverkey(arrows, 0.78, 1.03, typical, f"{typical:.2f} mm", labelpos="E",
                   fontproperties={"size": 8})
    for feature, place in zip(features, at, strict=True):
        if feature.verdict != "in_tolerance":
            axes.annotate(feature.id, place, xytext=(4, 4), textcoords="offset points", fontsize=8)
    axes.set_xlabel(f"{side[0]} (mm)", fontsize=8)
    axes.set_ylabel(f"{side[1]} (mm)", fontsize=8)
    axes.margins(0.12)
    axes.tick_params(labelsize=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(visible=True, color="#e6e8eb", linewidth=0.6)


def _pick(point: np.ndarray, side: tuple[str, str]) -> list[float]:
    return [float(point["xyz".index(axis)]) for axis in side]


def _as_svg(figure: Figure) -> str:
    page = io.StringIO()
    figure.savefig(page, format="svg",
                   metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = page.getvalue()
    return text[text.index("<svg"):]
