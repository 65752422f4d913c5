"""What can change the last digits of a number: software, and the processor's features that numpy
and OpenCV choose their kernels by.
"""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np

import cell
from cell import __version__

PACKAGES = ("numpy", "scipy", "rerun-sdk", "pyarrow", "pydantic")


def collect_versions() -> dict[str, str]:
    """Collect the versions that a start record holds, as texts by name."""
    return dict(_collect_once())


@cache
def _collect_once() -> dict[str, str]:
    """What runs does not change while it runs, and reading all sources takes a while."""
    return {
        "cell": __version__,
        "cell_code": _code_hash(),
        "python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
        "opencv": cv2.__version__,
        "system": f"{platform.system()} {platform.machine()} {'-'.join(platform.libc_ver())}",
        **_kernels(),
    }


def _code_hash() -> str:
    """Hash the sources of all that enters a number: the floors `core` and `metrology`."""
    root = Path(cell.__file__).parent
    digest = hashlib.sha256()
    for floor in ("core", "metrology"):
        for source in sorted((root / floor).rglob("*.py")):
            digest.update(f"{source.relative_to(root)}\n".encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _kernels() -> dict[str, str]:
    """What dispatch depends on: features found on this processor, and how libraries were built."""
    built = np.show_config(mode="dicts")
    blas = built["Build Dependencies"]["blas"]
    return {
        "numpy_features": " ".join(built["SIMD Extensions"].get("found", [])),
        "numpy_baseline": " ".join(built["SIMD Extensions"].get("baseline", [])),
        "blas": f"{blas.get('name')} {blas.get('version')}",
        "opencv_features": cv2.getCPUFeaturesLine(),
        "opencv_build": hashlib.sha256(cv2.getBuildInformation().encode()).hexdigest()[:16],
    }
