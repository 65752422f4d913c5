"""What an image of the virtual camera costs: CPU time, one core, printed as a table."""

import time

import cv2
import numpy as np
import pytest
from made_scenes import demo_scene, demo_world, over_hole

from cell.sim.bodies import Delivery, draw_body
from cell.sim.render import Setting, render
from cell.sim.render_lens import Lens
from cell.sim.render_light import Lamps

pytestmark = pytest.mark.bench


def test_cpu_time_of_an_image():
    cv2.setNumThreads(1)
    scene, world = demo_scene(), demo_world()
    lens = Lens(world.sensor)
    lens.prepare()
    setting = Setting(world.base_from_fixture, draw_body(scene, Delivery(1)), scene.boards,
                      scene.spheres)
    chance = np.random.default_rng(1)
    means = {}
    print("\nhole       ring ms   laser ms")
    for hole in ("SI1", "SI3", "BP1", "BP4", "HP1", "RR2", "QP3"):
        pose = over_hole(hole, lean_deg=(2.0, -1.0)) @ world.flange_from_camera
        costs = []
        for ring in (True, False):
            lamps = Lamps(world.sensor, ring, not ring, 1)
            render(lens, setting, pose, lamps, 0.005, chance)
            begun = time.process_time()
            for _ in range(5):
                render(lens, setting, pose, lamps, 0.005, chance)
            costs.append((time.process_time() - begun) / 5)
        means[hole] = costs
        print(f"{hole:8} {1000 * costs[0]:9.0f} {1000 * costs[1]:10.0f}")
    print(f"mean     {1000 * np.mean(list(means.values())):9.0f}")
