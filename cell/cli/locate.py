"""`cell locate`: one pair of images, in the camera frame."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import typer

from cell.cli.words import answers, console, print_json
from cell.core.errors import DocumentError, UnmeasurableError

if TYPE_CHECKING:
    from cell.core.documents.calibration import SensorDocument
    from cell.core.documents.result import Located
    from cell.core.observation import Image
    from cell.metrology.features import Expected

    Outcome: TypeAlias = Located | UnmeasurableError

LOCATED, REFUSED = 0, 1
FEWEST_PX = 3.0  # of a radius; below there is no edge to speak of
LEAST_FACING = 0.5  # cosine of the tilt


class Method(StrEnum):
    """How the circle is estimated."""

    joint = "joint"
    two_step = "two-step"


def locate(
    sensor: Path = typer.Option(..., metavar="FILE", help="The sensor: camera and light plane."),
    hole: Path = typer.Option(..., metavar="PNG", help="The hole, under the ring light."),
    stripe: Path = typer.Option(..., metavar="PNG", help="The stripe, from the same place."),
    radius: float | None = typer.Option(None, metavar="MM", help="The nominal radius."),
    normal: tuple[float, float, float] | None = typer.Option(
        None, metavar="I J K", help="The sheet's nominal normal in the camera frame, either way."),
    normal_sigma_deg: float = typer.Option(0.35, metavar="D", help="Its standard deviation per "
                                                                   "tangent axis, degrees."),
    thickness: float | None = typer.Option(None, metavar="MM", help="The sheet's thickness."),
    method: Method = typer.Option(Method.joint, help="The joint estimate, or the plain two-step "
                                                     "method of the paper."),
    picture: Path | None = typer.Option(None, metavar="PNG", help="Draw what was seen, and why it "
                                                                  "was refused."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Locate the hole that the stripe crosses, in the camera frame (mm).

    What the plan knows (radius, normal, thickness) is not needed, but sharpens z by far: without a
    normal the tilt across the stripe is all but unknown.

    Exit code: 0 located, 1 refused (with a reason), 2 bad input.
    """
    from cell.archive.files import read_text
    from cell.archive.images import read_image
    from cell.core.documents.calibration import SensorDocument
    from cell.core.documents.text import parse
    from cell.metrology.locate.pair import locate_pair

    expected = _expect(radius, normal, normal_sigma_deg, thickness)
    document = parse(SensorDocument, read_text(sensor), str(sensor))
    _check_radius(radius, document)
    images = [read_image(path, document.image_size) for path in (hole, stripe)]
    outcome: Outcome
    try:
        outcome = locate_pair(images[0], images[1], document.model, expected, method.value)
    except UnmeasurableError as refused:
        outcome = refused
    if picture is not None:
        _draw(picture, images, outcome)
    _answer(outcome, as_json)
    raise typer.Exit(REFUSED if isinstance(outcome, UnmeasurableError) else LOCATED)


def _expect(radius: float | None, normal: tuple[float, float, float] | None,
            normal_sigma_deg: float, thickness: float | None) -> Expected:
    import numpy as np

    from cell.metrology.features import Expected

    for name, value, most in (("radius", radius, math.inf), ("thickness", thickness, 100.0),
                              ("normal-sigma-deg", normal_sigma_deg, 90.0)):
        if value is not None and not 0 < value <= most:
            raise DocumentError(f"expected a number above 0{_at_most(most)}; came {value:g}",
                                source=f"--{name}")
    direction = None
    if normal is not None:
        direction = np.array(normal, dtype=np.float64)
        length = float(np.linalg.norm(direction))
        if not 0 < length < math.inf:
            raise DocumentError("expected a direction; came " + " ".join(map(str, normal)),
                                source="--normal")
        direction = direction / length
        if abs(direction[2]) < LEAST_FACING:
            raise DocumentError("expected the normal of a sheet that the camera sees; came "
                                + " ".join(map(str, normal)), source="--normal")
    return Expected(normal=direction, normal_sigma=math.radians(normal_sigma_deg), radius=radius,
                    thickness=thickness)


def _at_most(most: float) -> str:
    return f" and at most {most:g}" if math.isfinite(most) else ""


def _check_radius(radius: float | None, sensor: SensorDocument) -> None:
    """Refuse a radius that this sensor cannot have in its image."""
    one_px = sensor.model.working_distance / sensor.camera_matrix[0][0]
    least, most = FEWEST_PX * one_px, max(sensor.image_size) * one_px
    if radius is not None and not least <= radius <= most:
        raise DocumentError(f"expected {least:.2g} to {most:.3g} mm, what fits this sensor's "
                            f"image; came {radius:g}", source="--radius")


def _answer(outcome: Outcome, as_json: bool) -> None:
    if as_json:
        print_json(_as_json(outcome))
    elif isinstance(outcome, UnmeasurableError):
        console.print(f"[magenta]refused:[/magenta] {outcome}", highlight=False, soft_wrap=True)
    else:
        _print(outcome)


def _as_json(outcome: Outcome) -> dict[str, Any]:
    if isinstance(outcome, UnmeasurableError):
        return {"ok": False, "reason": outcome.reason, "detail": outcome.detail}
    return {
        "ok": True,
        "method": outcome.method,
        "centre_mm": outcome.centre.tolist(),
        "radius_mm": outcome.radius,
        "normal": None if outcome.normal is None else outcome.normal.tolist(),
        "uncertainty_mm": dict(zip(("x", "y", "z", "radius"), _sigma(outcome), strict=True)),
        "budget_mm": {source: list(share) for source, share in outcome.budget.items()},
        "quality": {name: value for name, value in outcome.quality.items() if math.isfinite(value)},
    }


def _sigma(located: Located) -> list[float]:
    return [math.sqrt(located.covariance[axis, axis]) for axis in range(4)]


def _print(located: Located) -> None:
    from rich.table import Table

    table = Table("", "x", "y", "z", "radius", title=f"camera frame, mm ({located.method})")
    for name, row in {"located": (*located.centre, located.radius),
                      "u (k = 1)": _sigma(located)}.items():
        table.add_row(name, *(f"{value:.4f}" for value in row), style="bold")
    for source, share in located.budget.items():
        table.add_row(source, *(f"{value:.4f}" for value in share), style="dim")
    answers.print(table)


def _draw(path: Path, images: list[Image], outcome: Outcome) -> None:
    from cell.report.picture import draw_pair

    try:
        path.write_bytes(draw_pair(images[0], images[1], outcome))
    except OSError as error:
        raise DocumentError(f"cannot be written: {error.strerror}", source=str(path)) from None
