"""Arrays of other kinds than lengths: masks, indices and grey pictures being worked on."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Mask: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.intp]
Grey: TypeAlias = NDArray[np.float32]
