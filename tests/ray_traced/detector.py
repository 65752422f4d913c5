"""From the light of every pixel to 8 bits: lens blur, vignetting, speckle, shot and read noise."""

from dataclasses import dataclass

import cv2
import numpy as np

WHITE = 255


@dataclass(frozen=True)
class Lens:
    """What the lens does besides distorting.

    `blur` is the standard deviation of its point image in px, of which the part `disc` (of the
    variance) comes from being out of focus; `vignetting` is what the farthest corner loses.
    """

    blur: float
    disc: float
    vignetting: float

    def blurred(self, light):
        """Blur light (h, w) by a disc and a Gaussian, both area-true."""
        kernel = self.kernel()
        return cv2.sepFilter2D(
            light if kernel is None else cv2.filter2D(light, -1, kernel,
                                                      borderType=cv2.BORDER_REFLECT),
            -1, *[gauss(self.blur * np.sqrt(1.0 - self.disc))] * 2, borderType=cv2.BORDER_REFLECT)

    def kernel(self):
        """Give the disc (k, k): a disc's standard deviation is half its radius."""
        radius = 2.0 * self.blur * np.sqrt(self.disc)
        if radius < 0.3:
            return None
        reach, parts = int(np.ceil(radius)) + 1, 15
        fine = (np.arange((2 * reach + 1) * parts) + 0.5) / parts - 0.5 - reach
        inside = np.hypot(fine[:, None], fine) < radius
        kernel = inside.reshape(2 * reach + 1, parts, 2 * reach + 1, parts).mean(axis=(1, 3))
        return kernel / kernel.sum()

    def shade(self, size):
        """Give what of the light (h, w) the lens lets through."""
        width, height = size
        y, x = np.mgrid[:height, :width]
        rr = (x - width / 2.0) ** 2 + (y - height / 2.0) ** 2
        return 1.0 - self.vignetting * rr / rr.max()


def gauss(deviation):
    """Give a Gaussian's weights, 6 deviations to each side."""
    reach = int(np.ceil(6.0 * deviation)) + 1
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(deviation, 1e-3)) ** 2)
    return weights / weights.sum()


@dataclass(frozen=True)
class Chip:
    """The camera's chip: electrons a grey value, read noise and black level in grey values."""

    electrons: float
    read: float
    black: float

    def expose(self, rng, grey):
        """Take a picture (h, w) uint8 of light in grey values."""
        counted = rng.poisson(np.maximum(grey, 0.0) * self.electrons) / self.electrons
        read = counted + self.black + rng.normal(0.0, self.read, grey.shape)
        return np.clip(np.rint(read), 0, WHITE).astype(np.uint8)


def speckled(rng, light, speckle):
    """Multiply laser light (h, w) by speckle: the mean of so many patterns of a grain in px.

    The grain is the deviation of the pupil's Gaussian amplitude; a pixel averages over its area.
    """
    columns = np.flatnonzero(light.max(axis=0) > 1e-4 * light.max())
    if not len(columns):
        return light
    window = slice(columns[0], columns[-1] + 1)
    shape = (2 * light.shape[0], 2 * (columns[-1] + 1 - columns[0]))
    total = np.zeros(shape)
    for _ in range(2 * speckle.looks):
        total += cv2.GaussianBlur(rng.standard_normal(shape), (0, 0), 2.0 * speckle.grain) ** 2
    pattern = total.reshape(shape[0] // 2, 2, shape[1] // 2, 2).mean(axis=(1, 3))
    rough = light.copy()
    rough[:, window] *= pattern / pattern.mean()
    return rough
