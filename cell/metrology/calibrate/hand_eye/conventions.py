"""What rotations may have been before their numbers were taken for another convention's.

A robot gives a rotation as a rotation vector or as Euler angles of some order. Read by the wrong
convention, the numbers still make a rotation, and the right one can be had back from it: up to
branches, since one rotation has several vectors and several triples of angles.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from cell.core.geometry import Array

VECTOR = "rotation vectors"
ROUNDS = 2
EULER = {f"Euler angles {order}": order for order in ("xyz", "XYZ", "zyx", "ZYX", "ZYZ")}
TURNS = 29  # whole ones, that a half turn written in degrees may hide when read as radians


def other_meanings(given: Array) -> Iterator[tuple[str, Array]]:
    """List what rotations (n, 3, 3) may have been: in words, and the candidates (k, n, 3, 3)."""
    for read_as, written_as in permutations((VECTOR, *EULER), 2):
        yield (f"{written_as} that were read as {read_as}",
               _read(written_as, _numbers(read_as, given)))
    for convention in (VECTOR, *EULER):
        yield (f"{convention} in radians that were read as degrees",
               _read(convention, np.degrees(_numbers(convention, given)[:1])))
    yield (f"{VECTOR} in degrees that were read as radians",
           _read(VECTOR, np.radians(_vectors(given, range(-TURNS, TURNS + 1)))))
    quaternions = Rotation.from_matrix(given).as_quat()
    for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
        yield ("quaternions with the scalar at the other end",
               Rotation.from_quat(quaternions[:, order]).as_matrix()[None])
    yield "transposed matrices", np.swapaxes(given, 1, 2)[None]


def turns_between(rotations: Array, others: Array) -> Array:
    """Measure the angles (...) in rad between rotations (..., 3, 3)."""
    traces = np.einsum("...ij,...ij->...", rotations, others)
    return np.asarray(np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)))


def choose_branches(candidates: Array, turns: Array) -> Array:
    """Choose one of the candidates (k, n, 3, 3) for each view, (n, 3, 3).

    Those are taken whose turns against each other are most like `turns` (n, n) in rad: first
    against one view alone, then against the choice for all.
    """
    views = np.arange(candidates.shape[1])
    gaps = np.abs(turns_between(candidates[:, None, :1], candidates[None]) - turns[0])
    first = int(np.argmin(np.median(gaps.min(axis=1), axis=1)))
    chosen = candidates[np.argmin(gaps[first], axis=0), views]
    chosen[0] = candidates[first, 0]
    for _ in range(ROUNDS):
        between = turns_between(candidates[:, :, None], chosen[None, None])
        best = np.argmin(np.median(np.abs(between - turns), axis=2), axis=0)
        chosen = candidates[best, views]
    return np.asarray(chosen)


def _read(convention: str, numbers: Array) -> Array:
    flat = numbers.reshape(-1, 3)
    turns = (Rotation.from_rotvec(flat) if convention == VECTOR
             else Rotation.from_euler(EULER[convention], flat))
    return np.asarray(turns.as_matrix()).reshape(*numbers.shape, 3)


def _numbers(convention: str, given: Array) -> Array:
    """Write rotations by a convention: two branches (2, n, 3) within a turn, the usual first."""
    if convention == VECTOR:
        return _vectors(given, (0, -1))
    order = EULER[convention]
    angles = Rotation.from_matrix(given).as_euler(order)
    a, b, c = angles.T
    middle = -b if order[0] == order[2] else np.pi - b
    other = np.stack([a + np.pi, middle, c + np.pi], axis=1)
    return np.stack([angles, (other + np.pi) % (2.0 * np.pi) - np.pi])


def _vectors(given: Array, turns: range | tuple[int, ...]) -> Array:
    """Write rotations as rotation vectors (k, n, 3), with so many whole turns more."""
    vectors = Rotation.from_matrix(given).as_rotvec()
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    axes = vectors / np.maximum(angles, 1e-12)
    return np.stack([vectors + 2.0 * np.pi * turn * axes for turn in turns])
