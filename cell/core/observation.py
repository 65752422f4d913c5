"""What was seen of one hole: the only thing that a measurement is made from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cell.core.geometry import Transform

Image: TypeAlias = NDArray[np.uint8]
Light: TypeAlias = Literal["ring", "laser"]


@dataclass(frozen=True, eq=False)
class View:
    """One exposure: a picture and where the flange stood, as reached, before and after it.

    `image` (height, width) uint8; `exposure` s; `time` seconds since 1970 (UTC); `joints` (6,) rad
    as read before the exposure. `attempt` counts the tries at the hole from 0: a retake, a
    re-centred stop or a second stripe begins a new one.
    """

    image: Image
    light: Light
    exposure: float
    time: float
    base_from_flange_before: Transform
    base_from_flange_after: Transform
    joints: tuple[float, ...]
    attempt: int = 0


@dataclass(frozen=True, eq=False)
class Observation:
    """Everything seen of one hole.

    `body_from_predicted` is what the holes measured before on this body say of its displacement:
    it carries a nominal (a point as the drawing has it, in the body frame) to where the hole is
    expected. Identity where nothing is known yet.
    """

    hole_id: str
    views: tuple[View, ...]
    body_from_predicted: Transform

    def first(self, count: int) -> Observation:
        """Return the observation as it was after `count` views: what an earlier attempt knew."""
        return replace(self, views=self.views[:count])

    def with_views(self, views: tuple[View, ...]) -> Observation:
        """Return the observation with one attempt's views added."""
        return replace(self, views=self.views + views)
