"""The body from three sides, with the deviation of every hole as an arrow: one SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.core.documents.nominals import Hole
from cell.core.documents.result import Feature
from cell.core.geometry import Array

COLOURS = {"in_tolerance": "#2a9d5c", "out_of_tolerance": "#d1343c", "uncertain": "#d9901a",
           "not_measured": "#7a7f87"}
SIDES = (("x", "y", "from above"), ("x", "z", "from the side"), ("y", "z", "from the front"))
ARROW_SHARE = 0.13  # of the picture's width, for a typical arrow
TYPICAL, CAP = 80, 2.0  # percentile that sets the scale; longer arrows are cut at CAP times it
KEYS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # mm, of the arrow that shows the scale


def draw_deviations(features: Sequence[Feature], holes: Sequence[Hole]) -> str:
    """Draw the holes in body coordinates (mm) with magnified deviations; return an SVG element."""
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    by_id = {hole.id: hole for hole in holes}
    at = np.array([by_id[feature.id].centre for feature in features])
    shift = np.array([[(feature.deviation or {}).get(axis, 0.0) for axis in "xyz"]
                      for feature in features])
    length = np.linalg.norm(shift, axis=1)
    typical = max(float(np.percentile(length, TYPICAL)), 1e-3)
    shift = shift * np.minimum(1.0, CAP * typical / np.maximum(length, 1e-9))[:, None]
    for axes, (across, up, title) in zip(figure.subplots(1, 3), SIDES, strict=True):
        shown = ["xyz".index(across), "xyz".index(up)]
        _draw_side(axes, features, at[:, shown], shift[:, shown], typical)
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_xlabel(f"{across} (mm)", fontsize=8)
        axes.set_ylabel(f"{up} (mm)", fontsize=8)
    return _as_svg(figure)


def _draw_side(axes: Axes, features: Sequence[Feature], at: Array, shift: Array,
               typical: float) -> None:
    """Draw arrows of `shift` at the places `at` (n x 2, mm); one of `typical` mm is well seen."""
    scale = ARROW_SHARE * max(float(np.ptp(at, axis=0).max()), 1.0) / typical
    colours = [COLOURS[feature.verdict] for feature in features]
    axes.scatter(at[:, 0], at[:, 1], s=26, c=colours, zorder=3, edgecolors="white", linewidths=0.6)
    arrows = axes.quiver(at[:, 0], at[:, 1], shift[:, 0], shift[:, 1], color=colours,
                         angles="xy", scale_units="xy", scale=1.0 / scale, width=0.005, zorder=2)
    axes.update_datalim(at + scale * shift)  # or the longest arrow would leave the picture
    key = min(KEYS, key=lambda one: abs(np.log(one / typical)))
    axes.quiverkey(arrows, 0.78, 1.03, key, f"{key:g} mm", labelpos="E",
                   fontproperties={"size": 8})
    for feature, place in zip(features, at, strict=True):
        if feature.verdict != "in_tolerance":
            axes.annotate(feature.id, place, xytext=(4, 4), textcoords="offset points", fontsize=8)
    axes.margins(0.12)
    axes.tick_params(labelsize=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(visible=True, color="#e6e8eb", linewidth=0.6)


def _as_svg(figure: Figure) -> str:
    page = io.StringIO()
    figure.savefig(page, format="svg",
                   metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = page.getvalue()
    return text[text.index("<svg"):]
