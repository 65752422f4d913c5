"""Robust statistics of residuals: how far they scatter, and how many of them share one error."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cell.core.geometry import Array

LONGEST = 60    # neighbours that may share one error
NEGLIGIBLE = 0.1  # correlation


def robust_sigma(values: Array) -> float:
    """Estimate the standard deviation from the median of the absolute deviations."""
    return 1.4826 * middle(np.abs(values - middle(values)))


def middle(values: NDArray[Any]) -> float:
    """Give the (upper) median: as `np.median`, at a fraction of its cost."""
    return quantile(values, 0.5)


def quantile(values: NDArray[Any], share: float) -> float:
    """Give the value (of n) that a share of them lies below: `np.quantile`, not interpolated."""
    rank = min(int(share * len(values)), len(values) - 1)
    return float(np.partition(values, rank)[rank])


def correlation_length(residuals: Array) -> float:
    """Count the neighbours that share one error: the integral of the autocorrelation, at least 1.

    The variance of a mean of n residuals is that of one, times this, over n.
    """
    centred = residuals - residuals.mean()
    beyond = np.zeros(min(LONGEST, len(centred)) - 1)
    product = np.correlate(np.concatenate([centred, beyond]), centred, "valid")
    shares = product[1:] / max(float(product[0]), 1e-12)
    end = int(np.argmax(shares < NEGLIGIBLE)) if (shares < NEGLIGIBLE).any() else len(shares)
    return float(1.0 + 2.0 * shares[:end].sum())


def tukey_weights(residuals: Array, scale: float) -> Array:
    """Give the biweight (0..1) of residuals: 95 % efficient on Gaussian noise."""
    kept: Array = np.clip(1.0 - (residuals / (4.685 * scale)) ** 2, 0.0, None) ** 2
    return kept
