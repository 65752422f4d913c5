"""The report of a calibration set: verdict, gates, pictures, what limits the result; one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, select_autoescape

from cell.core.geometry import Array
from cell.metrology.calibrate.camera import CameraResult
from cell.metrology.calibrate.gates import Checked, Ruling
from cell.metrology.calibrate.hand_eye.calibration import HandEyeAnswer
from cell.metrology.calibrate.light_plane import LightPlaneResult
from cell.metrology.calibrate.sphere import SphereResult
from cell.report.calibration_pictures import (
    draw_before_and_after,
    draw_board_points,
    draw_coverage,
    draw_ellipsoid,
    draw_plane,
    draw_residuals,
    draw_sphere,
    draw_tilt_and_roll,
)


@dataclass(frozen=True, eq=False)
class CalibrationPage:
    """What the report is made of.

    `pixels` are the corners of all views, for the coverage map; `stillness` tells how still (mm,
    rms) the board stands in the views `numbers`, by the set before and by this one.
    """

    facts: Mapping[str, str]
    verdict: Ruling
    reasons: Sequence[str]
    gates: Mapping[str, Sequence[Checked]]
    camera: CameraResult | None
    light_plane: LightPlaneResult | None
    hand_eye: HandEyeAnswer | None
    pixels: Sequence[Array]
    image_size: tuple[int, int]
    sphere: SphereResult | None = None
    numbers: Sequence[int] = ()
    stillness: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class Picture:
    """A picture as the page shows it: its title, what it says, and the PNG in base 64.

    A `wide` one has the whole width of the page.
    """

    title: str
    says: str
    png: str
    wide: bool = False


def calibration_report(page: CalibrationPage) -> str:
    """Write the page of one set."""
    environment = Environment(loader=PackageLoader("cell.report"),
                              autoescape=select_autoescape(default=True))
    template = environment.get_template("calibration.html.j2")
    return template.render(page=page, pictures=draw_pictures(page))


def draw_pictures(page: CalibrationPage) -> list[Picture]:
    """Draw all pictures that the results allow, the wide ones last."""
    pictures = [Picture("Coverage of the image", "Every corner of every view; empty regions are "
                        "not calibrated.", draw_coverage(page.pixels, page.image_size))]
    if page.light_plane is not None:
        pictures.append(Picture("Light plane", "How far the stripe's points are from the plane, "
                                "pose by pose: box and line are the middle half and the median.",
                                draw_plane(page.light_plane)))
    if page.hand_eye is not None and page.hand_eye.held_out is not None:
        pictures += _of_hand_eye(page.hand_eye)
    if page.stillness is not None:
        pictures.append(Picture("Before and after", "How still the board stands in every view, by "
                                "the set that was active and by this one.",
                                draw_before_and_after(*page.stillness, page.numbers)))
    if page.sphere is not None:
        pictures.append(Picture("Sphere", "Where each pose alone would have the centre, against "
                                "all together, and how far its points lie outside: laser, camera, "
                                "hand-eye and arm together.", draw_sphere(page.sphere), wide=True))
    return sorted(pictures, key=lambda picture: picture.wide)


def _of_hand_eye(answer: HandEyeAnswer) -> list[Picture]:
    return [
        Picture("Tilt and roll", "One point a view: how the camera leaned and rolled over the "
                "board. A wide spread makes a good hand-eye.", draw_tilt_and_roll(answer)),
        Picture("Residuals", "How far the board is missed in each view; hollow bars were kept out "
                "of the fit.", draw_residuals(answer)),
        Picture("The board in all views", "Where each view puts the corners of the board; what "
                "a whole view is off by is pose, what one corner is off by is picture.",
                draw_board_points(answer)),
        Picture("Uncertainty at the working distance", "Where a point on the optic axis may truly "
                "be, from the covariance of the fit: the ellipsoid of one standard deviation.",
                draw_ellipsoid(answer), wide=True),
    ]
