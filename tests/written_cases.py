"""Solved OpenFOAM cases with exact numbers, written without OpenFOAM: a rectangle of nx x ny cells, binary.

    top
+---+---+---+        left, right: patch        bottom, top: wall
|   |   |   | right  front and behind: empty
+---+---+---+
|   |   |   |        U at the cells' centres and the faces of patches; phi from psi at the corners
+---+---+---+
    bottom
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
# (x, y) -> (psi, u_x, u_y)
Flow = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]
Rectangle = tuple[tuple[float, float], tuple[float, float]]

DEPTH = 0.1
SIDES = ("left", "right", "bottom", "top")


def write_file(path: Path, kind: str, body: bytes, written: str = "binary") -> None:
    """A file of OpenFOAM's with its header."""
    head = f'FoamFile\n{{\n version 2.0;\n format {written};\n arch "LSB;label=32;scalar=64";\n'
    head += f" class {kind};\n object {path.name};\n}}\n\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(head.encode() + body + b"\n")


def listed(values: NDArray[np.generic], dtype: str) -> bytes:
    """A list in binary."""
    return f"{len(values)}\n(".encode() + values.astype(dtype).tobytes() + b")"


class Faces:
    """The faces of the mesh, those inside first, then patch by patch."""

    def __init__(self, nx: int, ny: int) -> None:
        inside, owners, neighbours = [], [], []
        for cell in range(nx * ny):
            j, i = divmod(cell, nx)
            if i + 1 < nx:
                inside.append([(i + 1, j), (i + 1, j + 1)])
                owners.append(cell)
                neighbours.append(cell + 1)
            if j + 1 < ny:
                inside.append([(i + 1, j + 1), (i, j + 1)])
                owners.append(cell)
                neighbours.append(cell + nx)
        rims = {
            "left": [([(0, j + 1), (0, j)], j * nx) for j in range(ny)],
            "right": [([(nx, j), (nx, j + 1)], j * nx + nx - 1) for j in range(ny)],
            "bottom": [([(i, 0), (i + 1, 0)], i) for i in range(nx)],
            "top": [([(i + 1, ny), (i, ny)], (ny - 1) * nx + i) for i in range(nx)],
        }
        self.starts = {}
        for name, rim in rims.items():
            self.starts[name] = len(inside), len(rim)
            inside += [ends for ends, _ in rim]
            owners += [cell for _, cell in rim]
        # (F, 2, 2): both ends of each edge that a face is, seen along z; the owner lies on their left.
        self.ends: Ints = np.array(inside)
        layer = (nx + 1) * (ny + 1)
        point = self.ends[..., 1] * (nx + 1) + self.ends[..., 0]
        between = np.stack((point[:, 0], point[:, 1], point[:, 1] + layer, point[:, 0] + layer), 1)
        first = np.array([j * (nx + 1) + i for j in range(ny) for i in range(nx)])
        back = np.stack((first, first + nx + 1, first + nx + 2, first + 1), axis=1)
        front = np.stack((first, first + 1, first + nx + 2, first + nx + 1), axis=1) + layer
        self.corners: Ints = np.concatenate((between, back, front))
        self.owners = np.concatenate((owners, np.arange(nx * ny), np.arange(nx * ny)))
        self.neighbours = np.array(neighbours)
        self.starts["frontAndBack"] = len(between), 2 * nx * ny


def write_mesh(case: Path, box: Rectangle, nx: int, ny: int, folder: str = "constant") -> Faces:
    """The mesh of a rectangle, and an empty controlDict; the faces."""
    faces, at = Faces(nx, ny), case / folder / "polyMesh"
    x, y = (np.linspace(*side, n + 1) for side, n in zip(box, (nx, ny), strict=True))
    plane = np.stack([axis.ravel() for axis in np.meshgrid(x, y)], axis=1)
    points = np.concatenate(
        [np.column_stack((plane, np.full(len(plane), z))) for z in (0.0, DEPTH)]
    )
    write_file(at / "points", "vectorField", listed(points, "<f8"))
    begins = 4 * np.arange(len(faces.corners) + 1)
    compact = listed(begins, "<i4") + b"\n" + listed(faces.corners.ravel(), "<i4")
    write_file(at / "faces", "faceCompactList", compact)
    write_file(at / "owner", "labelList", listed(faces.owners, "<i4"))
    write_file(at / "neighbour", "labelList", listed(faces.neighbours, "<i4"))
    kinds = dict.fromkeys(("left", "right"), "patch") | dict.fromkeys(("bottom", "top"), "wall")
    kinds["frontAndBack"] = "empty"
    patches = "".join(
        f"{name} {{ type {kinds[name]}; nFaces {count}; startFace {start}; }}\n"
        for name, (start, count) in faces.starts.items()
    )
    write_file(at / "boundary", "polyBoundaryMesh", f"5\n(\n{patches})\n".encode(), "ascii")
    write_file(case / "system" / "controlDict", "dictionary", b"", "ascii")
    return faces


def write_case(
    case: Path, box: Rectangle, cells: tuple[int, int], flows: Mapping[str, Flow]
) -> Path:
    """A case solved at times, each named as its folder, with its flow.

    cells : (nx, ny)
    """
    nx, ny = cells
    faces = write_mesh(case, box, nx, ny)
    x, y = (np.linspace(*side, n + 1) for side, n in zip(box, cells, strict=True))
    centres = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    middle = np.stack((x[faces.ends[..., 0]], y[faces.ends[..., 1]]), axis=-1).mean(axis=1)
    corners = x[faces.ends[..., 0]], y[faces.ends[..., 1]]
    for name, flow in flows.items():
        inside = _vectors(flow, *centres)
        on_faces = _vectors(flow, *middle.T)
        body = b"dimensions [0 1 -1 0 0 0 0];\ninternalField nonuniform List<vector> "
        body += listed(inside, "<f8") + b";\nboundaryField\n{\n"
        for side in SIDES:
            start, count = faces.starts[side]
            body += f"{side} {{ type fixedValue; value nonuniform List<vector> ".encode()
            body += listed(on_faces[start : start + count], "<f8") + b"; }\n"
        body += b"frontAndBack { type empty; }\n}\n"
        write_file(case / name / "U", "volVectorField", body)
        psi = flow(*corners)[0]
        # Out of the owner, which lies on the left of the way from end to end: u . n = d psi along it.
        _write_fluxes(case / name / "phi", faces, DEPTH * (psi[:, 1] - psi[:, 0]))
    return case


def _vectors(flow: Flow, x: Floats, y: Floats) -> Floats:
    _, u_x, u_y = flow(x, y)
    parts = np.broadcast_arrays(u_x, u_y, np.zeros(np.shape(x)))
    return np.stack([part.ravel() for part in parts], axis=1)


def _write_fluxes(path: Path, faces: Faces, flux: Floats) -> None:
    inner = len(faces.neighbours)
    body = b"dimensions [0 3 -1 0 0 0 0];\ninternalField nonuniform List<scalar> "
    body += listed(flux[:inner], "<f8") + b";\nboundaryField\n{\n"
    for side in SIDES:
        start, count = faces.starts[side]
        body += f"{side} {{ type calculated; value nonuniform List<scalar> ".encode()
        body += listed(flux[start : start + count], "<f8") + b"; }\n"
    body += b"frontAndBack { type empty; value nonuniform List<scalar> 0; }\n}\n"
    write_file(path, "surfaceScalarField", body)


def plate(time: float, speed: float = 1.0, k: float = 2.0, omega: float = 2.0 * np.pi) -> Flow:
    """Stokes' second problem, a plate at y = 0 that oscillates: u_x = U e^(-k y) cos(omega t - k y)."""

    def flow(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        phase = omega * time - k * y
        decay = speed * np.exp(-k * y)
        psi = -decay * (np.cos(phase) + np.sin(phase)) / (2.0 * k)
        return psi + 0.0 * x, decay * np.cos(phase) + 0.0 * x, 0.0 * x

    return flow
