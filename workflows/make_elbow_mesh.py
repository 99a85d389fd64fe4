"""Make the mesh of foam_cases/elbow: triangles without any order, one cell thick.

python workflows/make_elbow_mesh.py [--size 0.1] [--out foam_cases/elbow]

A channel of width 1 that turns left by a quarter:

                   outlet
                  |     |           inner: from the inlet's upper corner, around (2, 2) with radius 1
                  |     |           outer: from its lower one, around (2, 2) with radius 2
     inner _______/     |
    inlet               /           inlet at x = 0, 0 < y < 1; outlet at y = 4, 3 < x < 4
     outer ____________/
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from ellipsoid_coupling.flow.openfoam.case import Mesh
from ellipsoid_coupling.flow.openfoam.fields import PatchFaces
from ellipsoid_coupling.flow.openfoam.own_mesh import write_own_mesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CASE = Path(__file__).parents[1] / "foam_cases" / "elbow"
DEPTH = 0.1
# Rounds in which each inner point goes to the mean of its neighbours.
ROUNDS = 10
# Of the size: inner points are at least so far from the walls; the lattice that they start from is turned.
LEAST_DISTANCE, TURNED = 0.7, 0.3


def rim(size: float) -> list[tuple[str, Array]]:
    """The patches and their points (n, 2), one after another, the fluid on the left."""

    def line(start: tuple[float, float], end: tuple[float, float]) -> Array:
        count = max(round(float(np.hypot(end[0] - start[0], end[1] - start[1])) / size), 1)
        return np.linspace(start, end, count + 1)

    def arc(radius: float, start: float, end: float) -> Array:
        count = max(round(radius * abs(end - start) / size), 1)
        angle = np.linspace(start, end, count + 1)
        return 2.0 + radius * np.stack((np.cos(angle), np.sin(angle)), axis=-1)

    down, right = -0.5 * np.pi, 0.0
    return [
        ("outer", np.vstack((line((0, 0), (2, 0)), arc(2.0, down, right)[1:], line((4, 2), (4, 4))[1:]))),
        ("outlet", line((4, 4), (3, 4))),
        ("inner", np.vstack((line((3, 4), (3, 2)), arc(1.0, right, down)[1:], line((2, 1), (0, 1))[1:]))),
        ("inlet", line((0, 1), (0, 0))),
    ]  # fmt: skip


def inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """(n,), which points lie in the polygon: a ray to the right crosses it an odd number of times."""
    x, y = points[:, 0], points[:, 1]
    found = np.zeros(len(points), np.bool_)
    for (xa, ya), (xb, yb) in pairwise(np.vstack((polygon, polygon[:1])).tolist()):
        if ya != yb:
            found ^= ((ya > y) != (yb > y)) & (x < xa + (y - ya) * (xb - xa) / (yb - ya))
    return found


def triangulate(polygon: Array, size: float) -> tuple[Array, Index]:
    """Points (P, 2), those of the polygon first, and counter-clockwise triangles (T, 3)."""
    steps = np.arange(-80, 81) * size
    x, y = np.meshgrid(steps, steps * np.sqrt(0.75))
    x = x + 0.5 * size * (np.arange(len(steps)) % 2)[:, None]
    cos, sin = np.cos(TURNED), np.sin(TURNED)
    lattice = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1).reshape(-1, 2) + 2.0
    far = KDTree(polygon).query(lattice)[0] > LEAST_DISTANCE * size
    points = np.vstack((polygon, lattice[far & inside(lattice, polygon)]))
    fixed = len(polygon)
    for _ in range(ROUNDS):
        triangles = _within(points, polygon)
        pairs = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0)
        both = np.concatenate((pairs, pairs[:, ::-1]))
        total = np.zeros_like(points)
        np.add.at(total, both[:, 0], points[both[:, 1]])
        mean = total / np.bincount(both[:, 0], minlength=len(points))[:, None]
        points[fixed:] = mean[fixed:]
    return points, _within(points, polygon)


def _within(points: Array, polygon: Array) -> Index:
    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where((twice < 0)[:, None], triangles[:, ::-1], triangles)
    return np.asarray(triangles[inside((a + b + c) / 3.0, polygon)])


def extruded(points: Array, triangles: Index, patches: Sequence[tuple[str, int]]) -> Mesh:
    """A mesh of prisms; patches are names and numbers of edges, around the first points in turn."""
    count, cells = len(points), len(triangles)
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    cell = np.repeat(np.arange(cells), 3)
    order = np.lexsort((cell, ends.max(axis=1), ends.min(axis=1)))
    ends, cell = ends[order], cell[order]
    key = np.sort(ends, axis=1)
    twice = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    # Along its owner's rim, an edge has the neighbour on the right: outwards.
    owner, neighbour, inner = cell[twice], cell[twice + 1], ends[twice]
    upper = np.lexsort((neighbour, owner))
    owner, neighbour, inner = owner[upper], neighbour[upper], inner[upper]
    single = np.ones(len(ends), np.bool_)
    single[twice] = single[twice + 1] = False
    rim_ends, rim_owner = ends[single], cell[single]
    around = np.argsort(rim_ends[:, 0])
    edges = np.vstack((inner, rim_ends[around]))
    sides = np.column_stack((edges, edges[:, ::-1] + count))
    planes = np.vstack((triangles[:, ::-1], triangles + count))
    faces = [*sides, *planes]
    start, listed = len(inner), []
    for name, number in patches:
        kind = "patch" if name in ("inlet", "outlet") else "wall"
        listed.append(PatchFaces(name, kind, start, number))
        start += number
    listed.append(PatchFaces("frontAndBack", "empty", start, 2 * cells))
    flat = [np.column_stack((points, np.full(count, z))) for z in (0.0, DEPTH)]
    return Mesh(
        points=np.vstack(flat),
        corners=np.concatenate(faces),
        begins=np.concatenate(([0], np.cumsum([len(face) for face in faces]))),
        owner=np.concatenate((owner, rim_owner[around], np.tile(np.arange(cells), 2))),
        neighbour=neighbour,
        patches=listed,
    )


def main(arguments: Sequence[str] | None = None) -> Path:
    """Write the mesh; its folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=float, default=0.1)
    parser.add_argument("--out", type=Path, default=CASE)
    options = parser.parse_args(arguments)
    parts = rim(options.size)
    polygon = np.vstack([points[:-1] for _, points in parts])
    points, triangles = triangulate(polygon, options.size)
    # From the inlet on, so that neighbours have numbers that are close.
    middle = points[triangles].mean(axis=1)
    triangles = triangles[np.argsort(middle[:, 0] + middle[:, 1], kind="stable")]
    mesh = extruded(points, triangles, [(name, len(line) - 1) for name, line in parts])
    case = Path(options.out)
    folder, scratch = case / "constant" / "polyMesh", case / "new_mesh"
    write_own_mesh(mesh, scratch)
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    (scratch / "constant" / "polyMesh").rename(folder)
    shutil.rmtree(scratch)
    return folder


if __name__ == "__main__":
    print(main())
