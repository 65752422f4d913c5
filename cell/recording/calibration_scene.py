"""The live picture of a calibration: what the camera sees, where it goes, how far it has come."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import rerun as rr

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.core.optics import CameraModel
from cell.metrology.calibrate.camera import GRID
from cell.recording import colours
from cell.recording.calibration_blueprint import (
    COVERAGE,
    FIGURES,
    GOAL,
    LEANS,
    NOW,
    PREDICTED,
    RESULTS,
    WORLD,
    build_calibration_blueprint,
)
from cell.recording.calibration_moment import CalibrationMoment, Line, Picture, PlannedView
from cell.recording.hole_scene import LASER, NOTHING, RING, Drawing, markdown
from cell.recording.layout import CAMERA
from cell.recording.memory import send_blueprint

TIMELINE = "look"
PREVIEW_QUALITY = 85       # JPEG: for the eye alone
MAP_SCALE = 0.25           # of the coverage map to the image
IMAGE_AT = 110.0           # mm in front of the camera: where the 3D view shows the image
VIEW_AT = 26.0             # mm: the length of the small pyramid of a view
RINGS_DEG = (10.0, 20.0, 30.0)
TICK_DEG = 4.0             # length of the stroke that shows a roll
ROUND = np.linspace(0.0, 2.0 * np.pi, 61)
STATES = {"planned": (130, 132, 140), "next": (255, 205, 60), "taken": (80, 220, 120),
          "left out": (90, 70, 75)}
APART = (110, 190, 255)    # views that nothing is fitted to
EMPTY, FULL = np.array([70, 30, 34]), np.array([52, 130, 74])


class CalibrationScene:
    """Draws the moments of one session. Each is whole: what was lost before it is not missed."""

    def __init__(self, stream: rr.RecordingStream, moment: CalibrationMoment) -> None:
        self.session = moment.session
        self._stream, self._known = stream, moment.extent
        self._lay_out(moment)
        for path, *things in _draw_frame(moment.camera):
            stream.log(path, *things, static=True)

    def draw(self, moment: CalibrationMoment) -> None:
        """Draw one moment."""
        if moment.extent != self._known:
            self._lay_out(moment)
        self._stream.set_time(TIMELINE, sequence=moment.look)
        for path, *things in _draw(moment):
            self._stream.log(path, *things)

    def _lay_out(self, moment: CalibrationMoment) -> None:
        """Lay out the views: anew where it has become known what there is to look at."""
        self._known = moment.extent
        send_blueprint(self._stream, build_calibration_blueprint(moment))


def _draw_frame(camera: CameraModel) -> Iterator[Drawing]:
    """Draw what stays: the lens, and how plots and maps are to look."""
    yield "/", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    yield CAMERA, rr.Pinhole(
        image_from_camera=camera.matrix, resolution=camera.image_size,
        camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=IMAGE_AT)
    yield PREDICTED, rr.SeriesLines(colors=[colours.EDGE], names=["predicted uncertainty (mm)"],
                                    widths=[2.5])
    yield GOAL, rr.SeriesLines(colors=[colours.LIMIT], names=["goal"])
    yield (f"{LEANS}/rings", rr.LineStrips2D(
        [np.column_stack([size * np.cos(ROUND), size * np.sin(ROUND)]) for size in RINGS_DEG],
        colors=[STATES["planned"]], radii=rr.Radius.ui_points(0.6)),
        rr.Points2D([(0.0, -size) for size in RINGS_DEG], radii=0.0, colors=[STATES["planned"]],
                    labels=[f"{size:.0f} deg" for size in RINGS_DEG], show_labels=True))


def _draw(moment: CalibrationMoment) -> Iterator[Drawing]:
    yield NOW, markdown(describe(moment))
    yield from _draw_picture(RING, moment.ring, colours.EDGE)
    yield from _draw_picture(LASER, moment.laser, colours.STRIPE)
    yield from _draw_world(moment)
    yield COVERAGE, rr.Image(map_coverage(moment.corners, moment.camera.image_size),
                             color_model="RGB")
    yield f"{COVERAGE}/corners", rr.Points2D(
        MAP_SCALE * moment.corners, colors=[(235, 235, 235)], radii=rr.Radius.ui_points(1.0))
    yield from _draw_leans(moment.leans)
    if not np.isnan(moment.goal):
        yield PREDICTED, rr.Scalars([moment.predicted])
        yield GOAL, rr.Scalars([moment.goal])
    for number, (_, png) in enumerate(moment.results):
        yield f"{RESULTS}/{number}", rr.EncodedImage(contents=png, media_type="image/png")
    for name, value in moment.figures:
        yield f"{FIGURES}/{name.partition(' ')[0]}", rr.Scalars([value]), rr.SeriesLines(
            names=[name])


def describe(moment: CalibrationMoment) -> str:
    """Write the panel of a moment (markdown)."""
    rows = "".join(map(_row, sorted(moment.lines, key=lambda line: line.good is not False)))
    table = f"| | now | wanted | |\n|---|---:|---|---|\n{rows}" if rows else ""
    left = "" if np.isnan(moment.predicted) else \
        f"\n\nPredicted uncertainty **{moment.predicted:.3f} mm**, goal {moment.goal:.3f} mm."
    return f"# {moment.step}\n\n{moment.advice}{left}\n\n{table}\n\n{moment.title}"


def map_coverage(corners: Array, image_size: tuple[int, int]) -> Image:
    """Paint the cells of the image in which corners were seen; (height, width, 3) uint8."""
    width, height = (round(MAP_SCALE * size) for size in image_size)
    counts, _, _ = np.histogram2d(corners[:, 1], corners[:, 0], bins=GRID,
                                  range=((-0.5, image_size[1] - 0.5), (-0.5, image_size[0] - 0.5)))
    cells = np.where((counts > 0)[..., None], FULL, EMPTY).astype(np.uint8)
    return np.asarray(cv2.resize(cells, (width, height), interpolation=cv2.INTER_NEAREST))


def _row(line: Line) -> str:
    mark = {None: "", True: "ok", False: "**not met**"}[line.good]
    return f"| {line.name} | {line.value} | {line.wanted} | {mark} |\n"


def _draw_picture(path: str, picture: Picture | None, colour: tuple[int, int, int],
                  ) -> Iterator[Drawing]:
    if picture is None:
        yield path, rr.Clear(recursive=True)
        return
    image = rr.Image(picture.image, color_model="L").compress(jpeg_quality=PREVIEW_QUALITY)
    yield path, image
    yield f"{path}/found", rr.Points2D(
        picture.found if len(picture.found) else NOTHING, colors=[colour],
        radii=rr.Radius.ui_points(2.5))


def _draw_world(moment: CalibrationMoment) -> Iterator[Drawing]:
    if moment.base_from_camera is not None:
        yield CAMERA, rr.Transform3D(translation=moment.base_from_camera.translation,
                                     mat3x3=moment.base_from_camera.rotation)
    for index, outline in enumerate(moment.boards):
        yield f"{WORLD}/board{index}", rr.Mesh3D(
            vertex_positions=outline, triangle_indices=[[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]],
            albedo_factor=[225, 225, 215])
    if moment.sphere is not None:
        centre, radius = moment.sphere
        yield f"{WORLD}/sphere", rr.Points3D([centre], radii=[radius], colors=[(200, 200, 215)])
    if moment.planned:
        yield from _draw_views(moment.planned, moment.camera)


def _draw_views(planned: tuple[PlannedView, ...], camera: CameraModel) -> Iterator[Drawing]:
    """Draw each view of the plan as a small pyramid, with its number."""
    tints = [_tint(view) for view in planned]
    yield f"{WORLD}/views", rr.LineStrips3D(
        [_pyramid(view, camera) for view in planned], colors=tints,
        radii=rr.Radius.ui_points([2.2 if view.state == "next" else 1.0 for view in planned]))
    yield f"{WORLD}/numbers", rr.Points3D(
        [view.base_from_camera.translation for view in planned], colors=tints, show_labels=True,
        radii=rr.Radius.ui_points(2.0), labels=[str(view.number) for view in planned])


def _tint(view: PlannedView) -> tuple[int, int, int]:
    return APART if view.apart and view.state == "planned" else STATES[view.state]


def _pyramid(view: PlannedView, camera: CameraModel) -> Array:
    """The edges of a view's pyramid as one line (n, 3) in the base frame."""
    width, height = camera.image_size
    rays = camera.rays(np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64))
    a, b, c, d = VIEW_AT * rays
    tip = np.zeros(3)
    return view.base_from_camera @ np.array([tip, a, b, tip, c, d, tip, a, d, c, b])


def _draw_leans(leans: Array) -> Iterator[Drawing]:
    """Draw a point for how each view leaned, with a stroke the way that it was rolled."""
    middles, rolls = leans[:, :2], np.radians(leans[:, 2])
    ends = TICK_DEG * np.column_stack([np.cos(rolls), np.sin(rolls)])
    yield LEANS, rr.LineStrips2D([[middle, middle + end] for middle, end
                                  in zip(middles, ends, strict=True)], colors=[STATES["taken"]],
                                 radii=rr.Radius.ui_points(1.5)), rr.Points2D(
        middles, colors=[STATES["taken"]], radii=rr.Radius.ui_points(3.5))
