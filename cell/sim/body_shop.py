"""The body shop before the station: body after body, slowly drifting, now and then a bad one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array
from cell.sim.bodies import Delivery
from cell.sim.scene import SceneDocument

FAULTS = ("diameter", "position", "missing")


@dataclass(frozen=True)
class Built:
    """A body as it leaves the shop. `faults` says what is wrong with which hole, for judging."""

    number: int
    delivery: Delivery
    faults: dict[str, str]


@dataclass(frozen=True, eq=False)
class BodyShop:
    """Builds the body of any number: the same number of the same scene is the same body."""

    scene: SceneDocument

    def build(self, number: int) -> Built:
        """Build body `number` (0, 1, 2, ...)."""
        seed = self.scene.seed + 7919 * (number + 1)
        faults = self._faults(np.random.default_rng([seed, *b"faults"]))
        off = self._as_designed() | {hole: self._fault_off(hole, fault)
                                     for hole, fault in faults.items()}
        return Built(number, Delivery(seed, shifts=self._drift(number), off=off), faults)

    def _as_designed(self) -> dict[str, tuple[float, float, float]]:
        """Take back what puts holes of the scene off: the first body has it, and the master."""
        return {hole.id: _three(np.negative(hole.off)) for hole in self.scene.holes
                if any(hole.off)}

    def _drift(self, number: int) -> dict[str, tuple[float, float, float]]:
        """Tools wear: each panel wanders its own way, and jumps back when the tool is changed."""
        shop = self.scene.shop
        shifts = {}
        for index, panel in enumerate(self.scene.panels):
            way = np.random.default_rng([self.scene.seed, *panel.name.encode()]).normal(size=3)
            worn = ((number + 0.37 * index * shop.tool_life) % shop.tool_life) / shop.tool_life
            shifts[panel.name] = _three(shop.drift_mm * worn * way / np.linalg.norm(way))
        return shifts

    def _faults(self, chance: np.random.Generator) -> dict[str, str]:
        if chance.random() >= self.scene.shop.bad_share:
            return {}
        hole = self.scene.holes[int(chance.integers(len(self.scene.holes)))].id
        return {hole: FAULTS[int(chance.integers(len(FAULTS)))]}

    def _fault_off(self, hole: str, fault: str) -> tuple[float, float, float]:
        """Say by how much (u, v, diameter) a fault puts a hole off, mm."""
        entry = next(entry for entry in self.scene.holes if entry.id == hole)
        off = {"diameter": (0.0, 0.0, 0.5), "position": (2.4, -1.9, 0.0),
               "missing": (0.0, 0.0, -4.0 * entry.radius)}[fault]
        return _three(np.subtract(off, entry.off))


def _three(values: Array) -> tuple[float, float, float]:
    u, v, w = (float(value) for value in values)
    return u, v, w
