"""`scene.yaml`: the physical world of a virtual cell, and how far it may be from what is believed.

It stands on its own: nothing here is read from the cell's calibration or from the nominals. Design
values are what the makers drew; the magnitudes say how far the real things lie from them, and
`world` draws the truth from the seed. A magnitude of zero switches its error off.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from cell.core.documents.base import Document, Matrix3, Matrix4, Number, Vector2, Vector3, Vector4
from cell.core.documents.text import parse
from cell.core.errors import DocumentError

Positive = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]
Magnitude = Annotated[float, Field(ge=0, strict=True, allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=16, le=20_000)]
Seed = Annotated[int, Field(ge=0)]
Finish = Literal["steel", "galvanised", "ecoat_grey", "ecoat_black", "primer",
                 "ceramic"]


def _a_direction(vector: Vector3) -> Vector3:
    if not any(vector):
        raise ValueError("expected a direction, of any length but zero")
    return vector


class SensorScene(Document):
    """The sensor as designed: camera (px), light plane (camera frame, mm), lamps and lens.

    `stripe_sigma_mm` is the half thickness of the sheet of light; `laser` is where its light comes
    from, in the camera frame. `ring_level` and `laser_level` are grey values a second of exposure
    on a white sheet at the working distance.
    """

    image_size: tuple[Pixels, Pixels]
    camera_matrix: Matrix3
    distortion: tuple[Number, Number, Number, Number, Number]
    light_plane: Vector4
    laser: Vector3
    stripe_sigma_mm: Positive = 0.11
    ring_radius_mm: Positive = 36.0
    ring_level: Positive = 26000.0
    laser_level: Positive = 90000.0
    ambient_level: Magnitude = 500.0
    blur_px: Positive = 0.85
    defocus_px_per_mm: Magnitude = 0.03
    vignetting: Magnitude = 0.12
    dark_level: Magnitude = 4.0
    electrons_per_grey: Positive = 40.0
    read_noise: Magnitude = 1.3
    speckle: Magnitude = 1.0


class Wiring(Document):
    """Which standard digital output of the robot feeds which lamp."""

    ring: Annotated[int, Field(ge=0, le=15)] = 0
    laser: Annotated[int, Field(ge=0, le=15)] = 1


class SensorErrors(Document):
    """Standard errors of the believed sensor: a relative focal length, px, mm, degrees."""

    focal: Magnitude = 0.0
    principal_px: Magnitude = 0.0
    k1: Magnitude = 0.0
    k2: Magnitude = 0.0
    tangential: Magnitude = 0.0
    plane_mm: Magnitude = 0.0
    plane_deg: Magnitude = 0.0


class PoseErrors(Document):
    """Standard errors per axis of a believed pose."""

    mm: Magnitude = 0.0
    deg: Magnitude = 0.0


class ArmScene(Document):
    """How the true arm differs from the controller's model of it. `ideal` switches all of it off.

    Residual lengths and angles of the kinematic rows, hysteresis and repeatability of each joint
    (all standard deviations); the sway of the joints after a stop, which fades with `sway_s`; and
    the links' shortening when cold, which fades with `warm_up_s`.
    """

    model: Literal["ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"]
    ideal: bool = False
    length_mm: Magnitude = 0.0
    angle_deg: Magnitude = 0.0
    hysteresis_deg: Magnitude = 0.0
    repeatability_deg: Magnitude = 0.0
    sway_deg: Magnitude = 0.0
    sway_s: Positive = 0.05
    cold_mm: Magnitude = 0.0
    warm_up_s: Positive = 1800.0


class BodyErrors(Document):
    """How bodies differ: displaced in the fixture about `pivot` (greatest values), and the standard
    deviations of panels, holes and their form.
    """

    pivot: Vector3
    displacement_mm: Magnitude = 0.0
    displacement_deg: Magnitude = 0.0
    panel_mm: Magnitude = 0.0
    panel_deg: Magnitude = 0.0
    hole_mm: Magnitude = 0.0
    diameter_mm: Magnitude = 0.0
    form_mm: Magnitude = 0.0
    thickness_mm: Magnitude = 0.0


class ShopScene(Document):
    """How the body shop varies: panels wander by `drift_mm` over a tool's life of `tool_life`
    bodies, and a share of bodies has a bad hole.
    """

    drift_mm: Magnitude = 0.0
    tool_life: Annotated[int, Field(ge=1)] = 150
    bad_share: Annotated[float, Field(ge=0, le=1)] = 0.0


class Behind(Document):
    """A second sheet behind a panel, parallel to it, `gap_mm` from its back."""

    gap_mm: Positive
    finish: Finish


class Panel(Document):
    """A flat sheet of the body: the middle of its outer face and outward normal in body axes.

    On the face, u points to the right and v up (body z) as one looks at it. `edge_break_mm` is how
    much of the face is bent away at the rim of a hole.
    """

    name: str
    centre: Vector3
    normal: Annotated[Vector3, AfterValidator(_a_direction)]
    size: Vector2
    thickness: Positive
    finish: Finish
    edge_break_mm: Magnitude = 0.0
    behind: Behind | None = None


class HoleScene(Document):
    """A hole as the tool was made: where on which panel, its radius, which face the drawing means.

    `off` (u, v, diameter) is a deviation of its own that every body has.
    """

    id: str
    panel: str
    at: Vector2
    radius: Positive
    drawn_on: Literal["camera", "back"] = "camera"
    off: Vector3 = (0.0, 0.0, 0.0)


class Board(Document):
    """A ChArUco board. Its frame is OpenCV's: origin at the first corner, x along the columns, y
    down the rows, z into the board. `margin_mm` of white surrounds the squares.
    """

    name: str
    base_from_board: Matrix4
    squares: tuple[int, int]
    square_mm: Positive
    marker_mm: Positive
    dictionary: str = "DICT_4X4_100"
    margin_mm: Magnitude = 5.0


class Sphere(Document):
    """A matt ceramic sphere, its centre in the base frame."""

    name: str
    centre: Vector3
    radius: Positive


class SceneDocument(Document):
    """The world as a whole. `master` is the seed of the master body, which sits undisplaced."""

    name: str
    seed: Seed
    master: Seed
    sensor: SensorScene
    wiring: Wiring = Wiring()
    sensor_errors: SensorErrors = SensorErrors()
    flange_from_camera: Matrix4
    hand_eye_errors: PoseErrors = PoseErrors()
    arm: ArmScene
    base_from_fixture: Matrix4
    fixture_errors: PoseErrors = PoseErrors()
    bodies: BodyErrors
    shop: ShopScene = ShopScene()
    panels: tuple[Panel, ...]
    holes: tuple[HoleScene, ...]
    boards: tuple[Board, ...] = ()
    spheres: tuple[Sphere, ...] = ()

    @model_validator(mode="after")
    def _holes_lie_on_panels(self) -> SceneDocument:
        names = {panel.name for panel in self.panels}
        lost = [hole.id for hole in self.holes if hole.panel not in names]
        if lost:
            raise ValueError(f"holes on no panel: {', '.join(lost)}")
        if len({hole.id for hole in self.holes}) < len(self.holes):
            raise ValueError("two holes have the same id")
        return self


def read_scene(path: Path) -> SceneDocument:
    """Read and check a scene; DocumentError where it cannot be read or is wrong."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise DocumentError("expected UTF-8 text; came other bytes", source=str(path)) from None
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    return parse(SceneDocument, text, str(path))
