"""True bodies: sheets with bores, as one body has them, and how it sits in its fixture."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cell.core.geometry import Array, Transform
from cell.sim.scene import Behind, BodyErrors, Finish, HoleScene, Panel, SceneDocument

FORM_ORDERS = np.arange(2, 7)  # lobes of a punched hole; one lobe would be a shift
NEAR_RIM = 0.3  # mm; further away the form does not matter


@dataclass(frozen=True)
class Delivery:
    """Which body comes: a seed, and what is special about it.

    `displacement` (rx ry rz in degrees, x y z in mm, about the pivot) replaces the drawn one;
    `shifts` moves panels by (u, v, outward) mm, as a drifting body shop does; `off` gives holes a
    further deviation (u, v, diameter).
    """

    seed: int
    displacement: tuple[float, ...] | None = None
    shifts: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    off: dict[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bore:
    """One hole in a sheet: centre (u, v) on the outer face, radius, and its form's harmonics.

    A radius of 0 is a hole that was forgotten. `form` (2, n) holds cosine and sine amplitudes in mm
    of orders 2, 3, ...
    """

    id: str
    centre: Array
    radius: float
    form: Array
    drawn_on: str

    def outside(self, u: Array, v: Array) -> Array:
        """Return how far outside of the rim places (...) on the sheet lie, in mm."""
        across, up = u - float(self.centre[0]), v - float(self.centre[1])
        far = np.sqrt(across * across + up * up)
        beyond = far - self.radius
        near = np.abs(beyond) < NEAR_RIM
        towards = (across[near] + 1j * up[near]) / far[near]
        beyond[near] -= np.polyval(self._lobes, towards).real
        return beyond

    @cached_property
    def _lobes(self) -> NDArray[np.complex128]:
        """The form as a polynomial in exp(i angle), highest order first."""
        falling = (self.form[0] - 1j * self.form[1])[::-1]
        return np.concatenate([falling, np.zeros(FORM_ORDERS[0])])


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat sheet in the fixture: the frame (u, v, outward) of its outer face, size, bores."""

    name: str
    fixture_from_sheet: Transform
    size: tuple[float, float]
    thickness: float
    finish: Finish
    edge_break: float
    behind: Behind | None
    bores: tuple[Bore, ...]


@dataclass(frozen=True, eq=False)
class Body:
    """A body as it truly is, in the frame of its fixture."""

    delivery: Delivery
    fixture_from_body: Transform
    sheets: tuple[Sheet, ...]

    def truth(self) -> dict[str, Any]:
        """Describe every hole in the fixture's frame, on the face that its drawing means: mm."""
        return {"holes": [_describe(sheet, bore) for sheet in self.sheets for bore in sheet.bores],
                "fixture_from_body": self.fixture_from_body.matrix.tolist()}


def draw_body(scene: SceneDocument, delivery: Delivery) -> Body:
    """Draw the true body that a delivery stands for: the same delivery is the same body."""
    fixture_from_body = _displacement(scene.bodies, delivery)
    sheets = tuple(_draw_sheet(scene, panel, fixture_from_body, delivery)
                   for panel in scene.panels)
    return Body(delivery, fixture_from_body, sheets)


def master(scene: SceneDocument) -> Delivery:
    """Return the delivery of the master body, which a CMM has measured and which sits true."""
    return Delivery(scene.master, displacement=(0.0,) * 6)


def body_from_panel(panel: Panel) -> Transform:
    """Return the designed frame of a panel's outer face: u right, v up (body z), w outward."""
    outward = np.array(panel.normal) / np.linalg.norm(panel.normal)
    up = np.array([0.0, 0.0, 1.0]) - outward[2] * outward
    up = up / np.linalg.norm(up)
    return Transform.from_parts(np.column_stack([np.cross(up, outward), up, outward]),
                                panel.centre)


def _displacement(errors: BodyErrors, delivery: Delivery) -> Transform:
    chance = _chance(delivery.seed, "displacement")
    turn, shift = (_direction(chance) * chance.uniform(0.4, 1.0) for _ in range(2))
    turn, shift = np.radians(errors.displacement_deg) * turn, errors.displacement_mm * shift
    if delivery.displacement is not None:
        turn, shift = np.radians(delivery.displacement[:3]), np.array(delivery.displacement[3:])
    there = Transform.from_parts(np.zeros(3), errors.pivot)
    return there @ Transform.from_parts(turn, shift) @ there.inverse


def _draw_sheet(scene: SceneDocument, panel: Panel, fixture_from_body: Transform,
                delivery: Delivery) -> Sheet:
    errors, chance = scene.bodies, _chance(delivery.seed, panel.name)
    shift = errors.panel_mm * chance.standard_normal(3) + delivery.shifts.get(panel.name, 0.0)
    turn = np.radians(errors.panel_deg) * chance.standard_normal(3)
    frame = fixture_from_body @ body_from_panel(panel) @ Transform.from_parts(turn, shift)
    thickness = panel.thickness + errors.thickness_mm * float(np.clip(chance.normal(), -2, 2))
    bores = tuple(_draw_bore(errors, hole, delivery) for hole in scene.holes
                  if hole.panel == panel.name)
    return Sheet(panel.name, frame, panel.size, thickness, panel.finish, panel.edge_break_mm,
                 panel.behind, bores)


def _draw_bore(errors: BodyErrors, hole: HoleScene, delivery: Delivery) -> Bore:
    chance = _chance(delivery.seed, hole.id)
    u, v, diameter = np.add(hole.off, delivery.off.get(hole.id, (0.0, 0.0, 0.0)))
    centre = np.array(hole.at) + (u, v) + errors.hole_mm * chance.standard_normal(2)
    radius = hole.radius + 0.5 * (diameter + errors.diameter_mm * chance.standard_normal())
    radius = max(float(radius), 0.0)
    form = errors.form_mm * chance.standard_normal((2, len(FORM_ORDERS))) / FORM_ORDERS
    return Bore(hole.id, centre, radius, form, hole.drawn_on)


def _describe(sheet: Sheet, bore: Bore) -> dict[str, Any]:
    depth = -sheet.thickness if bore.drawn_on == "back" else 0.0
    centre = sheet.fixture_from_sheet @ np.array([*bore.centre, depth])
    return {"id": bore.id, "centre_mm": centre.tolist(), "diameter_mm": 2.0 * bore.radius,
            "face": bore.drawn_on, "thickness_mm": sheet.thickness,
            "normal": sheet.fixture_from_sheet.rotation[:, 2].tolist()}


def _direction(chance: np.random.Generator) -> Array:
    vector = chance.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _chance(seed: int, name: str) -> np.random.Generator:
    """Return a stream of chance of its own for every named thing: one does not shift another."""
    return np.random.default_rng([seed, *name.encode()])
