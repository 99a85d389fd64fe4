"""Whether a mesh is a plane one: one cell thick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.polygons import Index

Array = NDArray[np.float64]

# Relative; files may hold single precision, so numbers that differ by less are taken as equal.
SINGLE = 1e-5


def thin_axis(points: Array, where: str) -> int:
    """The axis along which the mesh is one cell thick, z first; InputError if there is none."""
    for axis in (2, 1, 0):
        depth = points[:, axis]
        tolerance = SINGLE * np.ptp(depth)
        if np.all((depth - depth.min() <= tolerance) | (depth.max() - depth <= tolerance)):
            return axis
    raise InputError(
        where, "a plane case, one cell thick along x, y or z", _layers(points),
        "Solve the flow as a plane case, one cell thick, with empty patches in front and behind.",
    )  # fmt: skip


def _layers(points: Array) -> str:
    """In words, how many cells thick a mesh is along the axis where those are the fewest."""
    counts = []
    for axis, name in enumerate("xyz"):
        depth = points[:, axis]
        tolerance = SINGLE * np.ptp(depth)
        order = np.argsort(depth)
        level = np.empty(depth.size, np.int_)
        level[order] = np.cumsum(np.diff(depth[order], prepend=depth.min()) > tolerance)
        number = int(level.max()) + 1
        flat = np.delete(points, axis, axis=1)
        if depth.size % number == 0 and _alike(flat, level, number):
            counts.append((number - 1, name))
    if not counts:
        return "a 3-D mesh"
    thick, name = min(counts)
    return f"a mesh {thick} cells thick along {name}"


def _alike(flat: Array, level: Index, number: int) -> bool:
    """Whether points (P, 2) are the same on each of the levels."""
    at = np.rint(flat / (SINGLE * max(float(np.ptp(flat)), 1e-300)))
    layers = at[np.lexsort((at[:, 1], at[:, 0], level))].reshape(number, -1, 2)
    return bool(np.all(np.bincount(level) == layers.shape[1]) and np.ptp(layers, axis=0).max() <= 1)
