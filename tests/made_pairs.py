"""Rendered pairs of random holes: surfaces, sheets, tilts and offsets that differ from scene to
scene, with the truth in the camera frame.
"""

from dataclasses import dataclass

import numpy as np
from made_scenes import demo_world
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.core.optics import SensorModel
from cell.metrology.features import Expected
from cell.sim.bodies import Body, Bore, Delivery, Sheet
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps
from cell.sim.scene import Behind

WORLD = demo_world()
LENS = Lens(WORLD.sensor)
SENSOR = SensorModel(WORLD.sensor.camera, WORLD.sensor.light_plane)
FINISHES = ("steel", "galvanised", "ecoat_grey", "primer")
EXPOSURES = {"ring": 0.008, "laser": 0.004}


@dataclass(frozen=True, eq=False)
class Scene:
    """A hole in a sheet and the camera over it; `centre` and `normal` in the camera frame."""

    sheet: Sheet
    base_from_camera: Transform
    centre: np.ndarray
    normal: np.ndarray
    radius: float

    def picture(self, light, rng, base_from_camera=None):
        """Render the picture by one light."""
        lamps = Lamps(WORLD.sensor, light == "ring", light == "laser", int(rng.integers(1 << 30)))
        setting = Setting(Transform.identity(), Body(Delivery(0), Transform.identity(),
                                                     (self.sheet,)))
        return render(LENS, setting, base_from_camera or self.base_from_camera, lamps,
                      EXPOSURES[light], rng)

    def pair(self, rng):
        """Render both pictures."""
        return self.picture("ring", rng), self.picture("laser", rng)

    def plan(self, rng, normal_sigma=0.0061):
        """What a plan knows: normal and radius a little off, the thickness right."""
        across = np.linalg.svd(self.normal[None])[2][1:]
        normal = self.normal + normal_sigma * rng.normal(size=2) @ across
        return Expected(normal=normal / np.linalg.norm(normal), normal_sigma=normal_sigma,
                        radius=self.radius + 0.03 * rng.normal(), thickness=self.sheet.thickness)


def draw_scene(rng, *, radius=None, tilt_deg=2.0, offset=2.0, form=0.004, finishes=FINISHES):
    """Draw a scene that the stripe crosses within 0.6 of the radius."""
    radius = radius or rng.uniform(2.5, 10.0)
    while True:
        lean = np.radians(tilt_deg) * rng.normal(size=2)
        place = rng.uniform(-1.0, 1.0, 3) * [offset, offset, min(offset, 2.0)]
        target = np.array([0.0, 0.0, SENSOR.working_distance]) + place
        if abs(SENSOR.light_plane.distance(target)) < 0.6 * radius:
            break
    turn = Rotation.from_euler("xyz", [np.pi + lean[0], lean[1], rng.uniform(0, 2 * np.pi)])
    camera_from_sheet = Transform.from_parts(turn.inv().as_matrix(), np.zeros(3))
    at = rng.uniform(-30.0, 30.0, 2)
    camera_from_sheet = Transform.from_parts(
        camera_from_sheet.rotation, target - camera_from_sheet.rotation @ [*at, 0.0])
    waves = np.zeros((2, 5))
    waves[:, :3] = rng.normal(0.0, form / np.sqrt(3.0), (2, 3))
    bore = Bore("H", at, float(radius), waves, "camera")
    behind = Behind(gap_mm=float(rng.uniform(8, 40)), finish="ecoat_grey") \
        if rng.random() < 0.3 else None
    sheet = Sheet("sheet", Transform.identity(), (400.0, 400.0),
                  float(rng.choice([0.7, 1.0, 1.5, 2.0])), str(rng.choice(finishes)),
                  float(rng.choice([0.0, 0.0, 0.01, 0.02])), behind, (bore,))
    return Scene(sheet, camera_from_sheet.inverse, target, camera_from_sheet.turn([0.0, 0.0, 1.0]),
                 float(radius))
