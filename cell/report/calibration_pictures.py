"""The pictures of a calibration: coverage, residuals, the board in all views, the uncertainty."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array, Transform
from cell.metrology.calibrate.hand_eye.calibration import HandEyeAnswer
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeResult
from cell.metrology.calibrate.light_plane import LightPlaneResult
from cell.metrology.calibrate.sphere import SphereResult
from cell.metrology.motions import lay_onto, point_shift

INK, MUTED, ACCENT = "#1b2a41", "#8d99ae", "#d1495b"
LARGER = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # by which board points may be drawn apart
GRID = 8
WIDE = (11.0, 3.4)  # inches: three plots in a row


def draw_coverage(pixels: Sequence[Array], image_size: tuple[int, int]) -> str:
    """Draw all corners over the cells of the image in which some were seen."""
    width, height = image_size
    points = np.concatenate(pixels)
    figure, axes = _new("x (px)", "y (px)", equal=True)
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=GRID,
                                  range=((0, height), (0, width)))
    axes.imshow(counts, extent=(0, width, height, 0), cmap="Blues", vmin=0,
                vmax=max(1.0, float(np.percentile(counts, 90)) * 1.6))
    axes.plot(points[:, 0], points[:, 1], ".", color=INK, markersize=1.5)
    return _png(figure)


def draw_plane(result: LightPlaneResult) -> str:
    """Draw the distance of the stripe's points from the plane, pose by pose."""
    figure, axes = _new("pose", "distance from the plane (mm)")
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    axes.boxplot([*result.residuals], showfliers=False, medianprops={"color": ACCENT})
    return _png(figure)


def draw_tilt_and_roll(answer: HandEyeAnswer) -> str:
    """Draw where the camera stood over the board: lean in its direction, roll as the colour."""
    problem = _problem(answer)
    turns = problem.camera_from_board[:, :3, :3]
    normals = turns[:, :, 2]
    quaternions = Rotation.from_matrix(turns @ turns[0].T).as_quat()
    rolls = np.degrees(2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3]))
    figure, axes = _new("lean about y (degrees)", "lean about x (degrees)", equal=True)
    drawn = axes.scatter(np.degrees(np.arcsin(normals[:, 0])), np.degrees(np.arcsin(normals[:, 1])),
                         c=(rolls + 180.0) % 360.0 - 180.0, cmap="twilight", s=44,
                         vmin=-180.0, vmax=180.0, edgecolors=INK, linewidths=0.6)
    figure.colorbar(drawn, label="roll against the first view (degrees)")
    return _png(figure)


def draw_residuals(answer: HandEyeAnswer) -> str:
    """Draw by how much each view misses the board, in the order of the views."""
    problem, result = _problem(answer), _result(answer)
    misses = _misses(problem, result)
    figure, axes = _new("view", "board missed by (mm rms)")
    apart = [number in answer.apart for number in answer.numbers]
    axes.bar([str(number) for number in answer.numbers], misses,
             color=["none" if out else INK for out in apart], edgecolor=INK)
    axes.tick_params(axis="x", labelsize=7)
    return _png(figure)


def draw_board_points(answer: HandEyeAnswer) -> str:
    """Draw the corners that every view puts on the board, their scatter magnified."""
    problem, result = _problem(answer), _result(answer)
    carried = [pose @ view.board.points_in_board
               for pose, view in zip(_reference_from_board(problem, result), problem.views,
                                     strict=True)]
    points = np.concatenate([view.board.points_in_board for view in problem.views])
    mean = lay_onto(points, np.concatenate(carried))
    figure, axes = _new("x on the board (mm)", "y on the board (mm)", equal=True)
    shifts = [mean.inverse @ some - view.board.points_in_board
              for some, view in zip(carried, problem.views, strict=True)]
    larger = _larger(points, np.concatenate(shifts))
    for shift, view in zip(shifts, problem.views, strict=True):
        off = view.board.points_in_board + larger * shift
        axes.plot(off[:, 0], off[:, 1], ".", markersize=2.5)
    axes.plot(points[:, 0], points[:, 1], "+", color=INK, markersize=4)
    axes.set_title(f"distances from the mean (+) {larger:g} times larger; one colour a view",
                   fontsize=9)
    return _png(figure)


def _larger(points: Array, shifts: Array) -> float:
    """Choose how much larger shifts (n, 3) can be drawn without running into the next corner."""
    corners = np.unique(points.round(3), axis=0)
    gaps = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    room = 0.5 * float(gaps[gaps > 0.0].min())
    widest = float(np.quantile(np.linalg.norm(shifts[:, :2], axis=1), 0.95))
    return float(max((factor for factor in LARGER if factor * widest < room), default=LARGER[0]))


def draw_ellipsoid(answer: HandEyeAnswer) -> str:
    """Draw the uncertainty of a point on the optic axis at the working distance, in three views."""
    result = _result(answer)
    point = np.array([[0.0, 0.0, answer.figures["working_distance_mm"]]])
    jacobian = point_shift(result.carrier_from_camera.turn(point))[0]
    turn = result.carrier_from_camera.rotation
    spread = turn.T @ jacobian @ result.covariance[:6, :6] @ jacobian.T @ turn
    figure = Figure(figsize=WIDE, layout="constrained")
    for place, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
        _ellipse(figure.add_subplot(1, 3, place + 1), spread, a, b)
    return _png(figure)


def draw_sphere(result: SphereResult) -> str:
    """Draw where each pose alone would have the sphere, and how far its points are off it."""
    figure = Figure(figsize=WIDE, layout="constrained")
    shifts = 1000.0 * result.shifts
    for place, (a, b) in enumerate(((0, 1), (0, 2))):
        axes = figure.add_subplot(1, 3, place + 1)
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        axes.axvline(0.0, color=MUTED, linewidth=0.8)
        axes.plot(shifts[:, a], shifts[:, b], "o", color=INK, markersize=5)
        for pose, at in enumerate(shifts[:, [a, b]], start=1):
            axes.annotate(str(pose), at, xytext=(4, 3), textcoords="offset points", fontsize=7)
        reach = 1.2 * float(np.abs(shifts).max())
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal",
                 xlabel=f"{'xyz'[a]} (µm)", ylabel=f"{'xyz'[b]} (µm)")
        axes.grid(alpha=0.3)
    axes = figure.add_subplot(1, 3, 3)
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    axes.boxplot([1000.0 * some for some in result.residuals], showfliers=False,
                 medianprops={"color": ACCENT})
    axes.set(xlabel="pose", ylabel="outside of the sphere (µm)")
    return _png(figure)


def draw_before_and_after(before: Array, after: Array, numbers: Sequence[int]) -> str:
    """Draw how still the board stands (mm) in every view, by the set before and by this one."""
    figure, axes = _new("view", "board missed by (mm rms)")
    places = np.arange(len(numbers))
    axes.bar(places - 0.2, before, 0.4, color=MUTED, label="by the set before")
    axes.bar(places + 0.2, after, 0.4, color=INK, label="by this set")
    axes.set_xticks(places, [str(number) for number in numbers], fontsize=7)
    axes.legend(frameon=False, fontsize=8)
    return _png(figure)


def _ellipse(axes: Axes, spread: Array, a: int, b: int) -> None:
    values, vectors = np.linalg.eigh(spread[np.ix_([a, b], [a, b])])
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    x, y = 1000.0 * vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * circle)
    axes.fill(x, y, facecolor=ACCENT, alpha=0.15)
    axes.plot(x, y, color=ACCENT)
    axes.plot(0.0, 0.0, "+", color=INK)
    reach = 1300.0 * float(np.sqrt(np.diag(spread).max()))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_xlabel(f"{'xyz'[a]} of the camera (µm)")
    axes.set_ylabel(f"{'xyz'[b]} of the camera (µm)")
    axes.grid(alpha=0.3)


def _misses(problem: HandEyeProblem, result: HandEyeResult) -> list[float]:
    poses = _reference_from_board(problem, result)
    return [float(np.sqrt(np.mean(np.sum((pose @ view.board.points_in_board
                                          - result.reference_from_board
                                          @ view.board.points_in_board) ** 2, axis=1))))
            for pose, view in zip(poses, problem.views, strict=True)]


def _reference_from_board(problem: HandEyeProblem, result: HandEyeResult) -> list[Transform]:
    poses = (problem.reference_from_carrier @ result.carrier_from_camera.matrix
             @ problem.camera_from_board)
    return [Transform(pose) for pose in poses]


def _problem(answer: HandEyeAnswer) -> HandEyeProblem:
    assert answer.kept is not None
    return answer.kept


def _result(answer: HandEyeAnswer) -> HandEyeResult:
    assert answer.held_out is not None
    return answer.held_out.result


def _new(x: str, y: str, *, equal: bool = False) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.4, 3.8), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)
    if equal:
        axes.set_aspect("equal", adjustable="box")
    return figure, axes


def _png(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return base64.b64encode(stream.getvalue()).decode("ascii")
