"""The lens and the chip: where each pixel looks, and how light becomes grey values.

Images of light are float32 (height, width), in grey values a second of exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.core.geometry import Array
from cell.core.observation import Image
from cell.sim.world import TrueSensor

Light: TypeAlias = NDArray[np.float32]
Grid: TypeAlias = NDArray[Any]  # of single or double precision
COARSE = 16   # px between the nodes at which slowly changing light is computed
FINE = 6      # sub-pixels along each axis where an edge runs through a pixel


@dataclass(frozen=True, eq=False)
class Rays:
    """Normalised coordinates x, y (...) of lines of sight: the ray is (x, y, 1).

    Those of whole images are in single precision: 0.0004 px; those of edges in double.
    """

    x: Grid
    y: Grid

    def along(self, direction: Array) -> Grid:
        """Return the scalar product (...) of the rays with a vector (3,) of the camera frame."""
        right, down, ahead = (float(part) for part in direction)  # keeps single precision single
        return self.x * right + self.y * down + ahead

    def at(self, rows: slice, columns: slice) -> Rays:
        """Return the rays of a rectangle of pixels."""
        return Rays(self.x[rows, columns], self.y[rows, columns])


@dataclass(frozen=True, eq=False)
class Lens:
    """The true optics of a sensor, with every ray of its pixels worked out once."""

    sensor: TrueSensor

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        width, height = self.sensor.camera.image_size
        return height, width

    @cached_property
    def rays(self) -> Rays:
        """The rays through the middles of all pixels, (height, width)."""
        return Rays(*(part.astype(np.float32) for part in self._normalised))

    def prepare(self) -> None:
        """Work out everything that is worked out once, before the first image needs it."""
        _ = self.rays, self.coarse_rays, self._slopes, self._vignette

    @cached_property
    def coarse_rays(self) -> Rays:
        """The rays of a coarse lattice over the image, margins included."""
        height, width = self.shape
        rows = np.arange(0, height + COARSE, COARSE)
        columns = np.arange(0, width + COARSE, COARSE)
        nodes = np.stack(np.meshgrid(columns, rows), axis=-1)
        normalised = self.sensor.camera.normalise(nodes)
        return Rays(normalised[..., 0], normalised[..., 1])

    def sub_rays(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Rays:
        """Return FINE x FINE rays within each of n pixels, (n, FINE²): linear over a pixel."""
        steps = (np.arange(FINE) + 0.5) / FINE - 0.5
        across, down = (axis.ravel() for axis in np.meshgrid(steps, steps))
        jacobian = [grid[rows, columns, None] for grid in self._slopes]
        x, y = (part[rows, columns, None] for part in self._normalised)
        return Rays(x + jacobian[0] * across + jacobian[1] * down,
                    y + jacobian[2] * across + jacobian[3] * down)

    def spread(self, coarse: Array) -> Light:
        """Interpolate values on the coarse lattice to all pixels."""
        height, width = self.shape
        matrix = np.array([[1.0 / COARSE, 0.0, 0.0], [0.0, 1.0 / COARSE, 0.0]])
        return cv2.warpAffine(coarse.astype(np.float32), matrix, (width, height),
                              flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                              borderMode=cv2.BORDER_REPLICATE)

    def expose(self, light: Light, distance: float, exposure: float,
               chance: np.random.Generator | None) -> Image:
        """Turn light into an image: vignetting, blur, saturation, shot and read noise, 8 bits.

        Args:
            light: what comes along each ray, grey values a second.
            distance: mm along the optic axis to what is seen: off the working distance it blurs.
            exposure: s.
            chance: None leaves out the noise.
        """
        design = self.sensor.design
        grey = design.dark_level + exposure * self._blurred(light * self._vignette, distance)
        if chance is not None:
            sigma = np.sqrt(np.maximum(grey, 0.0) / design.electrons_per_grey
                            + design.read_noise ** 2)
            grey = grey + sigma * chance.standard_normal(grey.shape, dtype=np.float32)
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)

    def _blurred(self, light: Light, distance: float) -> Light:
        defocus = self.sensor.design.defocus_px_per_mm * (distance - self.working_distance)
        sigma = float(np.hypot(self.sensor.design.blur_px, defocus))
        return cv2.GaussianBlur(light, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)

    @cached_property
    def working_distance(self) -> float:
        """Where the lens is sharp and the sheet of light crosses its axis, mm."""
        plane = self.sensor.light_plane
        return -plane.offset / float(plane.normal[2])

    @cached_property
    def _vignette(self) -> Light:
        height, width = self.shape
        rows, columns = np.indices(self.shape)
        radius2 = ((columns - width / 2) ** 2 + (rows - height / 2) ** 2) / (width / 2) ** 2
        return (1.0 - self.sensor.design.vignetting * radius2).astype(np.float32)

    @cached_property
    def _slopes(self) -> tuple[Grid, ...]:
        """dx/dcolumn, dx/drow, dy/dcolumn, dy/drow of the rays."""
        return tuple(np.gradient(part, axis=axis) for part in self._normalised for axis in (1, 0))

    @cached_property
    def _normalised(self) -> tuple[Array, Array]:
        rows, columns = np.indices(self.shape)
        normalised = self.sensor.camera.normalise(np.stack([columns, rows], axis=-1))
        return normalised[..., 0], normalised[..., 1]
