"""Other people's cases as tests make them: a solved cavity whose files are changed.

The fixtures `case` and `known` stand in conftest.py.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ellipsoid_coupling.flow import FlowField

DATA = Path(__file__).parents[2] / "data"
MESH_FOLDER = "constant/polyMesh"
U, BOUNDARY, POINTS = "3.95/U", f"{MESH_FOLDER}/boundary", f"{MESH_FOLDER}/points"


def change(path: Path, pattern: bytes, new: bytes, count: int = 1) -> None:
    """Replace a pattern, which must be there, in a file."""
    data, found = re.subn(pattern, lambda _: new, path.read_bytes(), count=count, flags=re.DOTALL)
    assert found
    path.write_bytes(data)


def same(one: FlowField, other: FlowField, accuracy: float = 0.0) -> bool:
    """Whether two fields' coefficients are the same, relative to the largest."""
    a, b = one.arrays.coefficients, other.arrays.coefficients
    return a.shape == b.shape and bool(np.abs(a - b).max() <= accuracy * np.abs(b).max())
