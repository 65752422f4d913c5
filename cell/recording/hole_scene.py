"""What is drawn of one hole: its images with what was found in them, and its numbers in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import rerun as rr

from cell.core.documents.calibration import Calibration
from cell.core.documents.nominals import AXES
from cell.core.documents.record import HoleRecord
from cell.core.documents.result import Feature, Measured
from cell.core.geometry import Array
from cell.recording import colours, layout

Drawing: TypeAlias = tuple[str, *tuple[rr.AsComponents, ...]]
"""An entity's path, and what to log there; several things of one entity take less room."""

Colour: TypeAlias = tuple[int, int, int]
Trace: TypeAlias = Mapping[str, Array]

CROSS = 12.0  # px
NOTHING = np.zeros((0, 2))
RING, LASER = layout.IMAGES
VERDICT = "/verdict"
NO_AXES = 0.0  # mm: they would look like deviations
CAMERA_IMAGE_AT = 120.0  # mm in front of the camera: where the 3D view shows the image


def draw_camera(calibration: Calibration) -> Iterator[Drawing]:
    """Draw what stays of the camera: its lens, without the distortion."""
    camera = calibration.sensor.model.camera
    lens = rr.Pinhole(image_from_camera=camera.matrix, resolution=camera.image_size,
                      camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=CAMERA_IMAGE_AT)
    yield layout.CAMERA, lens, rr.TransformAxes3D(NO_AXES)


def draw_hole(record: HoleRecord, calibration: Calibration) -> Iterator[Drawing]:
    """Draw one hole: where the camera stood, and what was found in what it saw."""
    yield from _draw_stand(record, calibration)
    outcome = record.outcome if record.attempts else None
    yield from _draw_trace(outcome.located.trace if isinstance(outcome, Measured) else {})


def draw_summary(record: HoleRecord, feature: Feature) -> Iterator[Drawing]:
    """Write the numbers of a hole, and put its verdict on the time line."""
    yield VERDICT, markdown(summarise(record, feature)), rr.StateChange(state=feature.verdict)


def markdown(text: str) -> rr.TextDocument:
    """Make a text for the viewer, which dies of a letter that its font does not have."""
    legible = text.encode("latin-1", errors="replace").decode("latin-1")
    return rr.TextDocument(legible, media_type="text/markdown")


def order_of_views(record: HoleRecord) -> list[int]:
    """Order the views so that those that count come last: the viewer shows the last."""
    views, outcome = record.observation.views, record.outcome if record.attempts else None
    counts = views[outcome.reference].attempt if isinstance(outcome, Measured) else -1
    return sorted(range(len(views)), key=lambda index: views[index].attempt == counts)


def _draw_stand(record: HoleRecord, calibration: Calibration) -> Iterator[Drawing]:
    if not record.observation.views:
        return
    outcome = record.outcome
    index = outcome.reference if isinstance(outcome, Measured) else -1
    view = record.observation.views[index]
    body_from_camera = calibration.body_from_camera(view.base_from_flange_before)
    yield layout.CAMERA, rr.Transform3D(translation=body_from_camera.translation,
                                        mat3x3=body_from_camera.rotation)


def _draw_trace(trace: Trace) -> Iterator[Drawing]:
    """Draw the points, the ellipse and the paper's A, B and Q; empty where there are none, so that
    the hole before does not show through.
    """
    a_b_q = np.vstack([trace.get("chord", NOTHING), np.atleast_2d(trace.get("q", NOTHING))])
    yield (f"{RING}/found", _points(trace.get("rim"), colours.EDGE, 1.5),
           draw_lines(trace, dict.fromkeys(("ellipse", "across", "down"), colours.ELLIPSE)))
    yield (f"{LASER}/found", _points(trace.get("stripe"), colours.STRIPE, 1.5),
           draw_lines(trace, {"ellipse": colours.ELLIPSE, "chord": colours.CHORD}))
    yield f"{LASER}/points", _points(a_b_q, colours.CHORD, 4.0, ["A", "B", "Q"])


def _points(points: Array | None, colour: Colour, radius: float,
            labels: Sequence[str] = ()) -> rr.Points2D:
    rows = np.atleast_2d(NOTHING if points is None else points)
    return rr.Points2D(rows, colors=[colour], radii=rr.Radius.ui_points(radius),
                       labels=labels[:len(rows)] or None, show_labels=bool(labels))


def _cross(trace: Trace) -> dict[str, Array]:
    """A cross over the centre: two strips."""
    if "centre" not in trace:
        return {}
    x, y = np.ravel(trace["centre"])
    return {"across": np.array([[x - CROSS, y], [x + CROSS, y]]),
            "down": np.array([[x, y - CROSS], [x, y + CROSS]])}


def draw_lines(trace: Trace, tints: Mapping[str, Colour]) -> rr.LineStrips2D:
    """Draw the lines that `tints` names; `across` and `down` are a cross over the centre."""
    strips = {**trace, **_cross(trace)}
    drawn = [name for name in tints if name in strips]
    return rr.LineStrips2D([strips[name] for name in drawn], colors=[tints[n] for n in drawn],
                           radii=rr.Radius.ui_points(1.0))


def summarise(record: HoleRecord, feature: Feature) -> str:
    """Write the numbers of a hole as a table (markdown)."""
    head = f"# {feature.id}: {colours.words(feature.verdict)}\n\n"
    tried = "" if len(record.attempts) < 2 else f"after {len(record.attempts)} attempts\n\n"
    if not isinstance(feature.outcome, Measured):
        outcome = feature.outcome
        return f"{head}{tried}**{outcome.reason}**: {outcome.detail}\n"
    rows = "".join(_row(feature, axis) for axis in AXES)
    return (f"{head}{tried}| mm | nominal | measured | deviation | tolerance | U (k=2) |\n"
            f"|---|---:|---:|---:|---:|---:|\n{rows}\n"
            f"In the hole's plane {_number(feature.in_plane)}, along its normal "
            f"{_number(feature.along_normal)}; true position {_number(feature.true_position)}.\n")


def _row(feature: Feature, axis: str) -> str:
    def cell(values: Mapping[str, float] | None, factor: float = 1.0, sign: str = "") -> str:
        value = (values or {}).get(axis)
        return "·" if value is None else f"{factor * value:{sign}.3f}"

    out = feature.axis_verdicts.get(axis) == "out_of_tolerance"
    deviation = cell(feature.deviation, sign="+")
    return (f"| {axis} | {cell(feature.nominal)} | {cell(feature.measured)} "
            f"| {f'**{deviation}**' if out else deviation} | {cell(feature.tolerance)} "
            f"| {cell(feature.uncertainty, 2.0)} |\n")


def _number(value: float | None) -> str:
    return "·" if value is None else f"{value:.3f}"
