"""Papers of runs that never took place: every field filled with its own odd numbers."""

import cv2
import numpy as np
import pytest

from cell.core.documents.record import Attempt, HoleRecord, Start, Stop
from cell.core.documents.result import BodyResult, Feature, Located, Measured, NotMeasured
from cell.core.geometry import Transform
from cell.core.observation import Observation, View

NAN, INFINITE = float("nan"), float("inf")


class Papers:
    """Draws the papers of a run from a seed."""

    def __init__(self, seed: int, size: tuple[int, int] = (48, 64)) -> None:
        self.rng, self.size = np.random.default_rng(seed), size

    def start(self, **changes) -> Start:
        papers = {"job": "name: ü\n\tdoor ", "nominals": "id,x\r\n1,0.1\r\n", "empty": ""}
        return Start(**{"recording_id": "id", "body_id": "body 7", "started": 1.7e9 + 0.1,
                        "set_id": "set-1", "papers": papers, "versions": {"numpy": "2"},
                        "robot": {"serial": "1"}, "conditions": {"part_temperature_c": 1 / 3}}
                     | changes)

    def hole(self, index: int, views: int = 2) -> HoleRecord:
        observation = Observation(f"H{index}", tuple(self._view(k) for k in range(views)),
                                  self._transform())
        refused = NotMeasured(f"H{index}", "no_rim", "nothing found – dark")
        attempts = tuple(Attempt(2 * (k + 1), refused, "same_again") for k in range(views // 2 - 1))
        return HoleRecord(index, observation, (*attempts, Attempt(views, self.measured(index))))

    def measured(self, index: int) -> Measured:
        draw = self.rng.normal
        located, two_step = self._located("joint", draw(size=3)), self._located("two-step", None)
        two_step.trace["rim"] = located.trace["rim"].copy()  # the two share their points
        return Measured(f"H{index}", draw(size=3), 5.0 + draw(), draw(size=(4, 4)), None,
                        located, two_step, 1, {"robot": (0.0, -0.0, 5e-324, 1 / 3)})

    def stop(self, holes: int) -> Stop:
        feature = Feature("H0", "in_tolerance", self.measured(0), {"x": 1.0}, {"x": 0.1},
                          {"x": 1 / 3}, {"x": 0.1 + 0.2}, {"x": 1e-300}, {"x": "in_tolerance"})
        absent = Feature("H1", "not_measured", NotMeasured("H1", "no_rim", "dark"), {}, {})
        alignment = {"residuals": {"A": 0.1}, "body_from_aligned": [[1.0, 0.1 + 0.2]]}
        return Stop("complete", 1.7e9 + 1 / 3, holes, "", BodyResult("in_tolerance",
                    (feature, absent), alignment))

    def _located(self, method: str, normal) -> Located:
        draw = self.rng.normal
        return Located(method, draw(size=3), draw(), normal, draw(size=(4, 4)),
                       {"edge": (0.1, 0.2, NAN, INFINITE)}, {"residual": draw()},
                       {"rim": draw(size=(9, 2)), "nothing": np.zeros((0, 2))})

    def _view(self, index: int) -> View:
        coarse = self.rng.integers(0, 255, (6, 8)).astype(np.uint8)
        image = cv2.resize(coarse, self.size[::-1], interpolation=cv2.INTER_CUBIC)
        noisy = image + self.rng.integers(0, 3, self.size).astype(np.uint8)
        return View(noisy, ("ring", "laser")[index % 2], 0.008, 1.7e9 + index / 3,
                    self._transform(), self._transform(), tuple(self.rng.normal(size=6).tolist()),
                    index // 2)

    def _transform(self) -> Transform:
        return Transform.from_parts(self.rng.normal(size=3), 900.0 * self.rng.normal(size=3))


@pytest.fixture
def papers() -> Papers:
    return Papers(seed=7)


@pytest.fixture(autouse=True)
def _no_key(tmp_path, monkeypatch):
    """Keep the tests away from the key of whoever runs them."""
    monkeypatch.setenv("CELL_SEAL_KEY", str(tmp_path / "absent" / "seal.key"))
