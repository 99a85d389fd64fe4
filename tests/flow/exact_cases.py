"""Exact plane flows written as solved OpenFOAM cases, without OpenFOAM: mesh, U and phi, ascii or binary.

The mesh is one of `Grid`: lattices of quadrilaterals bent by a map. phi is the difference of the exact psi,
U its value in the cells' centroids and in the middle of the faces.
"""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.polygons import Edges, Polygons, polygons

Array = NDArray[np.float64]
Index = NDArray[np.int_]
Scalar = Callable[[Array, Array], Array]
Vector = Callable[[Array, Array], tuple[Array, Array]]

DEPTH = 0.1


class Exact(NamedTuple):
    """A flow: its stream function, its velocity, both of (x, y), and what walls are called.

    patch : of the boundary's edges by their middles (n, 2), a name each
    types : of the patches, by name
    wall : the velocity of walls at the middle of their edges; None where fluid slips along them
    jump : the flux through edges from (n, 2) to (n, 2), from their left to their right; psi's without it
    """

    psi: Scalar
    velocity: Vector
    patch: Callable[[Array], NDArray[np.str_]]
    types: dict[str, str]
    wall: Vector | None
    jump: Callable[[Array, Array], Array] | None = None


class Written(NamedTuple):
    """How files are written, and which of x, y, z comes first, second, third in them."""

    binary: bool = True
    packed: bool = False
    phi: bool = True
    axes: tuple[int, int, int] = (0, 1, 2)


class Grid(NamedTuple):
    """points (P, 2) and the four corners of each cell (C, 4), counter-clockwise."""

    points: Array
    cells: Index

    def polygons(self) -> Polygons:
        """The cells."""
        owner = np.repeat(np.arange(len(self.cells)), 4)
        return polygons(self.points, self.cells.ravel(), owner, len(self.cells))

    def moved(self, angle: float = 0.0, by: tuple[float, float] = (0.0, 0.0)) -> Grid:
        """Turned about the origin by `angle`, then shifted."""
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return Grid(self.points @ turn + by, self.cells)


def lattice(
    x: Array, y: Array, without: Callable[[Array, Array], NDArray[np.bool_]] | None = None
) -> Grid:
    """The lattice of lines x, y; cells whose centres are in `without` are left out."""
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    first = np.add.outer(x.size * np.arange(y.size - 1), np.arange(x.size - 1)).ravel()
    cells = first[:, None] + np.array([0, 1, x.size + 1, x.size])
    if without is not None:
        centres = points[cells].mean(axis=1)
        cells = cells[np.logical_not(without(*centres.T))]
        used, corners = np.unique(cells, return_inverse=True)
        points, cells = points[used], corners.reshape(-1, 4)
    return Grid(points, cells)


def annulus(radii: Array, sectors: int) -> Grid:
    """Rings of cells between radii, ascending."""
    angle = 2.0 * np.pi * np.arange(sectors) / sectors
    circle = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    points = (radii[:, None, None] * circle).reshape(-1, 2)
    ring, sector = np.divmod(np.arange((radii.size - 1) * sectors), sectors)
    here, beside = ring * sectors + sector, ring * sectors + (sector + 1) % sectors
    return Grid(points, np.stack((here, here + sectors, beside + sectors, beside), axis=-1))


def couette(inner: float = 1.0, outer: float = 2.0, spin: float = 1.0) -> Exact:
    """Between two cylinders, the inner one turns with angular velocity `spin`: u = a r + b / r."""
    a = -spin * inner**2 / (outer**2 - inner**2)
    b = -a * outer**2

    def psi(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        return np.asarray(-0.5 * a * r**2 - b * np.log(r))

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        rate = a + b / (x**2 + y**2)
        return -rate * y, rate * x

    def patch(at: Array) -> NDArray[np.str_]:
        return np.where(np.hypot(*at.T) < 0.5 * (inner + outer), "inner", "outer")

    def wall(x: Array, y: Array) -> tuple[Array, Array]:
        rate = np.where(np.hypot(x, y) < 0.5 * (inner + outer), spin, 0.0)
        return -rate * y, rate * x

    return Exact(psi, velocity, patch, {"inner": "wall", "outer": "wall"}, wall)


def past_cylinder(outer: float) -> Exact:
    """Potential flow past a cylinder of radius 1: psi = y (1 - 1 / r^2)."""

    def psi(x: Array, y: Array) -> Array:
        return y * (1.0 - 1.0 / (x**2 + y**2))

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x**2 + y**2
        return 1.0 - (x**2 - y**2) / r2**2, -2.0 * x * y / r2**2

    def patch(at: Array) -> NDArray[np.str_]:
        return np.where(np.hypot(*at.T) < 0.5 * (1.0 + outer), "cylinder", "far")

    return Exact(psi, velocity, patch, {"cylinder": "wall", "far": "patch"}, None)


def poiseuille(angle: float = 0.0) -> Exact:
    """The flow u = 4 y (1 - y) along a channel of height 1 that is turned by `angle`; see `Grid.moved`."""
    c, s = np.cos(angle), np.sin(angle)

    def across(x: Array, y: Array) -> Array:
        return np.asarray(c * y - s * x)

    def psi(x: Array, y: Array) -> Array:
        eta = across(x, y)
        return np.asarray(2.0 * eta**2 - 4.0 / 3.0 * eta**3)

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        eta = across(x, y)
        return 4.0 * eta * (1.0 - eta) * c, 4.0 * eta * (1.0 - eta) * s

    def patch(at: Array) -> NDArray[np.str_]:
        eta = across(*at.T)
        on_wall = (np.abs(eta) < 1e-9) | (np.abs(eta - 1.0) < 1e-9)
        along = c * at[:, 0] + s * at[:, 1]
        ends = np.where(along < 0.5 * (along.min() + along.max()), "inlet", "outlet")
        return np.where(on_wall, "walls", ends)

    types = {"inlet": "patch", "outlet": "patch", "walls": "wall"}
    return Exact(psi, velocity, patch, types, lambda x, y: (0.0 * x, 0.0 * y))


def plane_source(strength: float, middle: float = 0.0) -> Exact:
    """The flow of a source at the origin: u = q r / (2 pi r^2), whose psi is no function around it.

    middle : a radius; what lies within is the patch "inner", the rest "outer"
    """

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        rate = strength / (2.0 * np.pi * (x**2 + y**2))
        return rate * x, rate * y

    def jump(start: Array, stop: Array) -> Array:
        turn = np.arctan2(
            start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0], np.sum(start * stop, axis=1)
        )
        return np.asarray(strength * turn / (2.0 * np.pi))

    def patch(at: Array) -> NDArray[np.str_]:
        return np.where(np.hypot(*at.T) < middle, "inner", "outer")

    types = {"inner": "patch", "outer": "patch"} if middle else {"outer": "patch"}
    return Exact(lambda x, y: 0.0 * (x + y), velocity, patch, types, None, jump)


def wavy_channel(cells: int) -> tuple[Grid, Exact]:
    """One period of a channel of height H = 1 + sin(2 pi x) / 5: psi = eta^2 (3 - 2 eta), eta = y / H."""

    def height(x: Array) -> Array:
        return np.asarray(1.0 + 0.2 * np.sin(2.0 * np.pi * x))

    def psi(x: Array, y: Array) -> Array:
        eta = y / height(x)
        return np.asarray(eta**2 * (3.0 - 2.0 * eta))

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        eta = y / height(x)
        slope = 6.0 * eta * (1.0 - eta) / height(x)
        return slope, slope * eta * 0.4 * np.pi * np.cos(2.0 * np.pi * x)

    def patch(at: Array) -> NDArray[np.str_]:
        ends = np.where(at[:, 0] < 1e-9, "left", "right")
        inner = (at[:, 0] > 1e-9) & (at[:, 0] < 1.0 - 1e-9)
        return np.where(inner, "walls", ends)

    square = lattice(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1))
    x, eta = square.points.T
    grid = Grid(np.column_stack((x, eta * height(x))), square.cells)
    types = {"left": "cyclic", "right": "cyclic", "walls": "wall"}
    return grid, Exact(psi, velocity, patch, types, lambda x, y: (0.0 * x, 0.0 * y))


def write_case(
    folder: Path, grid: Grid, flow: Exact, written: Written | None = None, at: Array | None = None
) -> Path:
    """The case of a flow on a grid, in `folder`; at (2,) moves the mesh, not the flow.

    Returns the folder.
    """
    how = written or Written()
    cells = grid.polygons()
    edges = _inner_first(cells.edges(), grid.points, cells, flow)
    start, stop = edges.points.T
    inner = int(np.count_nonzero(edges.cells[:, 1] >= 0))
    middles = grid.points[edges.points].mean(axis=1)
    ends = grid.points[start], grid.points[stop]
    jump = flow.psi(*ends[1].T) - flow.psi(*ends[0].T) if flow.jump is None else flow.jump(*ends)
    phi = jump * DEPTH
    count, names = len(grid.points), flow.patch(middles[inner:])
    phi[inner:][[flow.types[name] == "wall" for name in names]] = 0.0
    shifted = grid.points + (0.0 if at is None else at)
    points = np.concatenate([
        np.column_stack((shifted, np.full(count, z))) for z in (0.0, DEPTH)
    ])  # fmt: skip
    faces = np.concatenate((
        np.stack((start, stop, stop + count, start + count), axis=-1),
        grid.cells[:, ::-1], grid.cells + count,
    ))  # fmt: skip
    both = np.tile(np.arange(len(grid.cells)), 2)
    mesh = folder / "constant" / "polyMesh"
    _save(mesh / "points", "vectorField", _vectors(points[:, how.axes], how), how)
    _save(mesh / "faces", "faceList", _faces(faces, how), how)
    _save(mesh / "owner", "labelList", _labels(np.concatenate((edges.cells[:, 0], both)), how), how)
    _save(mesh / "neighbour", "labelList", _labels(edges.cells[:inner, 1], how), how)
    patches = [(name, np.flatnonzero(names == name)) for name in flow.types]
    _save(
        mesh / "boundary",
        "polyBoundaryMesh",
        _boundary(patches, flow, inner, len(both)),
        Written(False),
    )
    _save(folder / "system" / "controlDict", "dictionary", b"", Written(False))
    velocity = _velocity(flow, cells.centroids(grid.points), middles[inner:], patches, how)
    _save(folder / "1" / "U", "volVectorField", velocity, how)
    if how.phi:
        _save(folder / "1" / "phi", "surfaceScalarField", _fluxes(phi, inner, patches, how), how)
    return folder


def _inner_first(edges: Edges, points: Array, cells: Polygons, flow: Exact) -> Edges:
    """Edges with their owner on the left; those inside first, then patch by patch."""
    start, stop = edges.points.T
    aside = cells.centroids(points)[edges.cells[:, 0]] - points[start]
    way = points[stop] - points[start]
    left = way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0] > 0.0
    ends = np.where(left[:, None], edges.points, edges.points[:, ::-1])
    name = flow.patch(points[edges.points].mean(axis=1))
    rank = np.zeros(len(ends), np.int_)
    for number, patch in enumerate(flow.types):
        rank[(name == patch) & (edges.cells[:, 1] < 0)] = number + 1
    order = np.argsort(rank, kind="stable")
    return Edges(ends[order], edges.cells[order])


def _velocity(
    flow: Exact, centres: Array, middles: Array, patches: list[tuple[str, Index]], how: Written
) -> bytes:
    parts = [b"dimensions [0 1 -1 0 0 0 0];\ninternalField nonuniform List<vector> "]
    parts += [_vectors(_flat(flow.velocity, centres)[:, how.axes], how), b";\nboundaryField\n{\n"]
    for name, at in patches:
        if flow.types[name] == "cyclic" or (flow.types[name] == "wall" and flow.wall is None):
            kind = b"cyclic" if flow.types[name] == "cyclic" else b"slip"
            parts.append(name.encode() + b" { type " + kind + b"; }\n")
            continue
        wall = flow.wall if flow.types[name] == "wall" and flow.wall is not None else None
        kind = b"calculated" if wall is None else b"fixedValue"
        values = _vectors(_flat(wall or flow.velocity, middles[at])[:, how.axes], how)
        parts += [
            name.encode(),
            b" { type ",
            kind,
            b"; value nonuniform List<vector> ",
            values,
            b"; }\n",
        ]
    return b"".join([*parts, b"frontAndBack { type empty; }\n}\n"])


def _fluxes(phi: Array, inner: int, patches: list[tuple[str, Index]], how: Written) -> bytes:
    parts = [
        b"dimensions [0 3 -1 0 0 0 0];\noriented oriented;\ninternalField nonuniform List<scalar> "
    ]
    parts += [_scalars(phi[:inner], how), b";\nboundaryField\n{\n"]
    for name, at in patches:
        values = _scalars(phi[inner:][at], how)
        parts += [
            name.encode(),
            b" { type calculated; value nonuniform List<scalar> ",
            values,
            b"; }\n",
        ]
    empty = b"frontAndBack { type empty; value nonuniform List<scalar> 0(); }\n}\n"
    return b"".join([*parts, empty])


def _flat(velocity: Vector, at: Array) -> Array:
    u_x, u_y = velocity(*at.T)
    return np.column_stack((u_x, u_y, np.zeros(len(at))))


def _boundary(patches: list[tuple[str, Index]], flow: Exact, first: int, others: int) -> bytes:
    lines = [f"{len(patches) + 1}\n("]
    for name, at in patches:
        lines.append(f"{name} {{ type {flow.types[name]}; nFaces {at.size}; startFace {first}; }}")
        first += at.size
    lines.append(f"frontAndBack {{ type empty; nFaces {others}; startFace {first}; }}\n)\n")
    return "\n".join(lines).encode()


def _vectors(values: Array, how: Written) -> bytes:
    if how.binary:
        return _raw(values, "<f8")
    return _text([f"({x!r} {y!r} {z!r})" for x, y, z in values.tolist()])


def _scalars(values: Array, how: Written) -> bytes:
    return _raw(values, "<f8") if how.binary else _text([repr(value) for value in values.tolist()])


def _labels(values: Index, how: Written) -> bytes:
    return _raw(values, "<i4") if how.binary else _text([str(value) for value in values.tolist()])


def _faces(faces: Index, how: Written) -> bytes:
    if how.binary:
        return _raw(4 * np.arange(len(faces) + 1), "<i4") + _raw(faces.ravel(), "<i4")
    return _text([f"4({' '.join(map(str, face))})" for face in faces.tolist()])


def _raw(values: NDArray[np.generic], dtype: str) -> bytes:
    return b"%d\n(" % len(values) + values.astype(dtype).tobytes() + b")\n"


def _text(entries: list[str]) -> bytes:
    return f"{len(entries)}\n(\n".encode() + "\n".join(entries).encode() + b"\n)\n"


def _save(path: Path, kind: str, body: bytes, how: Written) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    form, kind = ("binary", kind) if how.binary else ("ascii", kind)
    if how.binary and kind == "faceList":
        kind = "faceCompactList"
    head = (
        f'FoamFile\n{{\nversion 2.0;\nformat {form};\narch "LSB;label=32;scalar=64";\n'
        f"class {kind};\nobject {path.name};\n}}\n\n"
    ).encode()
    if how.packed:
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(head + body, mtime=0))
    else:
        path.write_bytes(head + body)
