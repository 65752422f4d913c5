"""What is drawn of the body: nominal and measured holes in its own axes, deviations, verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr

from cell.core.documents.nominals import AXES, Hole
from cell.core.documents.result import BodyResult, Feature
from cell.core.geometry import Array
from cell.recording import colours
from cell.recording.hole_scene import VERDICT, Drawing, markdown

EXAGGERATION = 200.0
"""How much longer than life a deviation is drawn: 1 mm shows as 200 mm."""

NOMINAL, MEASURED = "/body/nominal", "/body/measured"
PLOT, LIMITS, TABLE = "/deviation", "/deviation/limits", "/result"
ROUND = np.linspace(0.0, 2.0 * np.pi, 37)


def draw_nominals(holes: Sequence[Hole]) -> Iterator[Drawing]:
    """Draw the plan: the rim of every hole, its name, and how the plot is to look."""
    yield "/", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    yield NOMINAL, rr.LineStrips3D([_rim(hole) for hole in holes], colors=[colours.NOMINAL],
                                   radii=rr.Radius.ui_points(1.0))
    yield f"{NOMINAL}/names", rr.Points3D([hole.centre for hole in holes],
                                          colors=[colours.NOMINAL], labels=[h.id for h in holes],
                                          radii=rr.Radius.ui_points(1.5), show_labels=True)
    yield PLOT, rr.SeriesPoints(colors=[colours.AXES[axis] for axis in AXES], marker_sizes=[4.0],
                                names=list(AXES))
    yield LIMITS, rr.SeriesLines(colors=[colours.LIMIT] * 2, names=["upper limit", "lower limit"])
    yield VERDICT, rr.StateConfiguration(
        values=list(colours.VERDICTS), labels=[colours.words(name) for name in colours.VERDICTS],
        colors=list(colours.VERDICTS.values()))


def draw_features(features: Sequence[Feature], holes: Sequence[Hole]) -> Iterator[Drawing]:
    """Draw all features judged so far, coloured by verdict, with their deviations, exaggerated."""
    by_id = {hole.id: hole for hole in holes}
    tinted = [colours.VERDICTS[feature.verdict] for feature in features]
    centres = np.array([by_id[feature.id].centre for feature in features]).reshape(-1, 3)
    yield (MEASURED,
           rr.Points3D(centres, colors=tinted, radii=rr.Radius.ui_points(5.0), show_labels=False,
                       labels=[_label(feature) for feature in features]),
           rr.Arrows3D(origins=centres, colors=tinted, radii=rr.Radius.ui_points(1.5),
                       vectors=EXAGGERATION * np.array([_shift(f) for f in features]
                                                       ).reshape(-1, 3)))


def draw_deviation(feature: Feature) -> Iterator[Drawing]:
    """Draw one feature into the plot: each deviation as share of its tolerance."""
    deviation = feature.deviation or {}
    yield PLOT, rr.Scalars([deviation[axis] / feature.tolerance[axis] if axis in deviation
                            else np.nan for axis in AXES])


def draw_limits() -> Iterator[Drawing]:
    """Draw the tolerance into the plot, at one place of the time line."""
    yield LIMITS, rr.Scalars([1.0, -1.0])


def draw_result(result: BodyResult) -> Iterator[Drawing]:
    """Write the whole body as a table (markdown)."""
    rows = "".join(f"| {feature.id} | {colours.words(feature.verdict)} | {_deviations(feature)} "
                   f"| {feature.reason or ''} |\n" for feature in result.features)
    text = (f"# Body: {colours.words(result.verdict)}\n\n"
            f"| hole | verdict | dx | dy | dz | dd | reason |\n|---|---|---:|---:|---:|---:|---|\n"
            f"{rows}\ndeviations in mm")
    yield TABLE, markdown(text)


def _rim(hole: Hole) -> Array:
    """The nominal circle as points (37, 3), on the face that the nominal lies on."""
    first, second = np.linalg.svd(hole.normal[None, :])[2][1:]
    return hole.centre + hole.radius * (np.cos(ROUND)[:, None] * first
                                        + np.sin(ROUND)[:, None] * second)


def _shift(feature: Feature) -> list[float]:
    deviation = feature.deviation or {}
    return [deviation.get(axis, 0.0) for axis in "xyz"]


def _deviations(feature: Feature) -> str:
    deviation = feature.deviation or {}
    return " | ".join(f"{deviation[axis]:+.3f}" if axis in deviation else "·" for axis in AXES)


def _label(feature: Feature) -> str:
    found = [f"{axis} {value:+.3f}" for axis, value in (feature.deviation or {}).items()]
    return f"{feature.id}: {colours.words(feature.verdict)}\n" + ("\n".join(found)
                                                                  or str(feature.reason))
