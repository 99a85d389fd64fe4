"""What fields are compared with: a known stream function, and U as OpenFOAM has written it.

The stream function is zero on the unit square's walls; its lid moves.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from ellipsoid_coupling.flow import FlowField, WallVelocity
from ellipsoid_coupling.flow.polygons import Polygons, polygons

Array = NDArray[np.float64]


def velocity(x: Array, y: Array) -> tuple[Array, Array]:
    """(u_x, u_y) of psi = sin^2(pi x) e^x y^2 (1 - y) e^y."""
    wave, ramp = np.sin(np.pi * x) ** 2, y**2 * (1.0 - y)
    growth = np.exp(x + y)
    u_x = wave * (2.0 * y - 3.0 * y**2 + ramp) * growth
    return u_x, -(np.pi * np.sin(2.0 * np.pi * x) + wave) * ramp * growth


def stream(x: Array, y: Array) -> Array:
    """The stream function itself, exactly zero on the walls."""
    psi = np.sin(np.pi * x) ** 2 * y**2 * (1.0 - y) * np.exp(x + y)
    return np.where((x == 0.0) | (x == 1.0), 0.0, psi)


def spline(cells: int) -> FlowField:
    """Its spline on cells x cells, walls given."""
    nodes = np.linspace(0.0, 1.0, cells + 1)
    still = np.zeros(cells + 1)
    walls = WallVelocity(still, still, still, velocity(nodes, np.ones(cells + 1))[0])
    psi = stream(*np.meshgrid(nodes, nodes))
    return FlowField.from_stream_function(psi, nodes, nodes, "known", walls)


def points(number: int, seed: int = 1) -> tuple[Array, Array]:
    """Random points of the unit square, (number,) each."""
    x, y = np.random.default_rng(seed).random((2, number))
    return x, y


def shaken(cells: int, corners: int = 3) -> tuple[Array, Polygons]:
    """Points (P, 2) of a shaken lattice of the unit square; its cells have 3 or 4 corners."""
    nodes = np.linspace(0.0, 1.0, cells + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(nodes, nodes))
    shake = np.random.default_rng(0).uniform(-0.3, 0.3, (2, x.size)) / cells
    at = np.column_stack((
        x + shake[0] * ((x > 0.0) & (x < 1.0)), y + shake[1] * ((y > 0.0) & (y < 1.0)),
    ))  # fmt: skip
    if corners == 3:
        table = Delaunay(at).simplices.astype(np.int_)
    else:
        first = np.add.outer((cells + 1) * np.arange(cells), np.arange(cells)).ravel()
        table = first[:, None] + np.array([0, 1, cells + 1, cells + 2])
    owner = np.repeat(np.arange(len(table)), corners)
    return at, polygons(at, table.ravel(), owner, len(table))


def mismatch(case: Path, field: FlowField) -> float:
    """How far a field is from U in the cells of a solved square cavity, relative, rms.

    U is read in double precision from OpenFOAM's own file. Face fluxes make psi while U sits in
    cells, so the two differ by the mesh's error.
    """
    text = max(case.glob("[1-9]*/U")).read_text(encoding="utf-8")
    block = re.search(r"nonuniform List<vector>\s+\d+\s+\((.*?)\n\)", text, re.DOTALL)
    assert block is not None
    rows = [line.strip("()").split()[:2] for line in block[1].split("\n") if line]
    exact = np.array(rows, dtype=np.float64)
    cells = round(len(rows) ** 0.5)
    at = (np.arange(cells) + 0.5) / cells
    sample = field.evaluate(*np.meshgrid(at, at))
    found = np.stack((sample.velocity_x.ravel(), sample.velocity_y.ravel()), axis=-1)
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))
