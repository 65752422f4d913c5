"""The paper's figures 4, 5, 7 and 9 for a sensor of one's own, as one picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.core.errors import DocumentError
from cell.core.geometry import Array
from cell.metrology.locate.error_model import Ranges, SensorGeometry, error_x, error_y, error_z

STEPS = 61
LEVELS = 15


def draw_error_model(path: Path, sensor: SensorGeometry, ranges: Ranges) -> None:
    """Draw where the method is exact (figure 4), and dz, dx and dy over the tilt (5, 7 and 9).

    Raises:
        DocumentError: the picture cannot be written.
    """
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    (figure_4, figure_5), (figure_7, figure_9) = figure.subplots(2, 2)
    _draw_exact(figure_4, sensor, ranges)
    along = np.linspace(-1.0, 1.0, STEPS)
    beta = along * ranges.tilt
    # The stripe's distance is largest where x_d and z_d are: the axes of the paper's figures.
    x_d, z_d = along * ranges.x, along * ranges.z
    temp = x_d + z_d * np.tan(sensor.alpha)
    _draw_error(figure_5, temp, beta, error_z(sensor, x_d, z_d, beta[:, None]),
                ("5: error of z", "x_d + z_d tan α (mm)"))
    _draw_error(figure_7, x_d, beta, error_x(sensor, x_d, ranges.z * np.sign(x_d), beta[:, None]),
                ("7: error of x", "x_d (mm), z_d at the end of its range"))
    centre = (-ranges.x, along * ranges.y, -ranges.z)
    _draw_error(figure_9, centre[1], beta, error_y(sensor, centre, beta[:, None]),
                ("9: error of y", "y_d (mm), x_d and z_d at the end of their range"))
    figure.suptitle(f"Two-step method: L = {sensor.L:.2f} mm, "
                    f"α = {np.degrees(sensor.alpha):.2f} degrees")
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise DocumentError(f"the picture cannot be written: {error}", source=str(path)) from None


def _draw_exact(axes: Axes, sensor: SensorGeometry, ranges: Ranges) -> None:
    z_d = np.linspace(-ranges.z, ranges.z, STEPS)
    axes.plot(z_d, -z_d * np.tan(sensor.alpha), color="#1f5fa8", linewidth=2.0)
    axes.set_title("4: the light passes through the centre, no error at any tilt", fontsize=10)
    axes.set_xlabel("z_d (mm)")
    axes.set_ylabel("x_d (mm)")
    axes.grid(visible=True, color="#e6e8eb")


def _draw_error(axes: Axes, across: Array, beta: Array, error: Array,
                words: tuple[str, str]) -> None:
    largest = max(float(np.abs(error).max()), 1e-12)
    levels = np.linspace(-largest, largest, LEVELS)
    filled = axes.contourf(across, np.degrees(beta), error, levels, cmap="RdBu_r")
    axes.figure.colorbar(filled, ax=axes, label="mm", format="%.4f")
    axes.set_title(f"{words[0]}, at most {largest:.4f} mm", fontsize=10)
    axes.set_xlabel(words[1])
    axes.set_ylabel("tilt β (degrees)")
