"""`cell error-model`: what the two-step method errs by on a given sensor."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cell.cli.words import answers, print_json
from cell.core.errors import DocumentError

if TYPE_CHECKING:
    from cell.metrology.locate.error_model import Ranges

RADII = [3.0, 5.0, 10.0, 15.0]


def error_model(
    sensor: Path = typer.Option(..., metavar="FILE", help="The sensor: camera and light plane."),
    x: float = typer.Option(5.0, "--x-mm", metavar="MM", help="Range of x_d, either way."),
    y: float = typer.Option(5.0, "--y-mm", metavar="MM", help="Range of y_d, either way."),
    z: float = typer.Option(5.0, "--z-mm", metavar="MM", help="Range of z_d, either way."),
    tilt_deg: float = typer.Option(2.0, metavar="DEG", help="Range of the tilt β, either way."),
    radius: list[float] = typer.Option(RADII, metavar="MM", help="Radii for the general formula; "
                                                                 "may be repeated."),
    picture: Path | None = typer.Option(None, metavar="PNG", help="Draw the paper's figures 4, 5, "
                                                                  "7 and 9."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Say what the plain two-step method errs by when holes are tilted and off centre.

    L and alpha come from the light plane. First the paper's equations (15), (17) and (20), for a
    tilt about y; then the general formula, for a tilt in any direction and with the ellipse's
    eccentricity, which depends on the radius.
    """
    import numpy as np

    from cell.archive.files import read_text
    from cell.core.documents.calibration import SensorDocument
    from cell.core.documents.text import parse
    from cell.metrology.locate import error_model as model

    ranges = _ranges({"x": x, "y": y, "z": z}, tilt_deg, radius)
    plane = parse(SensorDocument, read_text(sensor), str(sensor)).model.light_plane
    geometry = model.SensorGeometry.from_light_plane(plane)
    rows = {r: model.general_extremes(plane, ranges, r) for r in radius}
    answer = {"L_mm": geometry.L, "alpha_deg": float(np.degrees(geometry.alpha)),
              "ranges": {"x_mm": x, "y_mm": y, "z_mm": z, "tilt_deg": tilt_deg},
              "paper_mm": _by_axis(model.paper_extremes(geometry, ranges).tolist()),
              "general_mm": [{"hole_radius": r, **_by_axis(row.tolist())}
                             for r, row in rows.items()]}
    if picture is not None:
        from cell.report.error_model import draw_error_model

        draw_error_model(picture, geometry, ranges)
    print_json(answer) if as_json else _print(answer)


def _ranges(reach: dict[str, float], tilt_deg: float, radii: list[float]) -> Ranges:
    from cell.metrology.locate.error_model import Ranges

    wrong = [f"--{name}-mm {value}" for name, value in reach.items() if not 0 < value < 100]
    wrong += [f"--tilt-deg {tilt_deg}"] if not 0 < tilt_deg <= 30 else []
    wrong += [f"--radius {value}" for value in radii if not 0 < value < 100]
    if wrong:
        raise DocumentError("expected lengths over 0 and under 100 mm, and a tilt over 0 and up to "
                            "30 degrees; came " + ", ".join(wrong))
    return Ranges(reach["x"], reach["y"], reach["z"], math.radians(tilt_deg))


def _by_axis(values: list[float]) -> dict[str, float]:
    return dict(zip(("x", "y", "z", "radius"), values, strict=False))


def _print(answer: dict[str, Any]) -> None:
    from rich.table import Table

    title = f"L = {answer['L_mm']:.4f} mm, alpha = {answer['alpha_deg']:.4f} degrees"
    table = Table("largest error, mm", "x", "y", "z", "radius", title=title)
    table.add_row("(17), (20), (15)", *_cells(answer["paper_mm"]), "")
    for row in answer["general_mm"]:
        table.add_row(f"any tilt, r = {row['hole_radius']:g}",
                      *_cells({axis: row[axis] for axis in ("x", "y", "z", "radius")}))
    answers.print(table)


def _cells(values: dict[str, float]) -> list[str]:
    return [f"{value:.4f}" for value in values.values()]
