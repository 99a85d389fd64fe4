"""What foamToVTK writes of a solved case, written without it: XML in ascii and single precision.

VTK/plate_0/internal.vtu   VTK/plate_0/boundary/left.vtp ...   VTK/plate_0.vtm   VTK/plate.vtm.series
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.openfoam.case import Mesh, Solution, read_solution
from ellipsoid_coupling.flow.openfoam.times import choose_time

Array = NDArray[np.generic]
# The corners of a hexahedron of VTK's are those of its lower face and then of its upper one.
_HEXAHEDRON, _CORNERS = 12, 8


def write_vtk(case: Path, names: Sequence[str], folder: Path) -> Path:
    """The times `names` of a case of hexahedra as files in `folder`."""
    files = []
    for index, name in enumerate(names):
        solution = read_solution(choose_time(case, name).places)
        step = folder / f"{case.name}_{index}"
        _write_internal(step / "internal.vtu", solution, name)
        for patch in solution.mesh.patches:
            if patch.kind != "empty":
                _write_patch(step / "boundary" / f"{patch.name}.vtp", solution, patch.name)
        step.with_name(f"{step.name}.vtm").write_text("<VTKFile type='vtkMultiBlockDataSet'/>\n")
        files.append({"name": f"{step.name}.vtm", "time": float(name)})
    text = json.dumps({"file-series-version": "1.0", "files": files})
    (folder / f"{case.name}.vtm.series").write_text(text)
    return folder


def _faces(mesh: Mesh) -> list[NDArray[np.int_]]:
    return [mesh.corners[a:b] for a, b in zip(mesh.begins[:-1], mesh.begins[1:], strict=True)]


def _hexahedra(mesh: Mesh) -> NDArray[np.int_]:
    """(C, 8), each cell between its face behind and its face in front, which lie in the plane of z."""
    middle = float(np.mean([mesh.points[:, 2].min(), mesh.points[:, 2].max()]))
    ends: dict[int, dict[bool, NDArray[np.int_]]] = {}
    for face, owner in zip(_faces(mesh), mesh.owner.tolist(), strict=True):
        above = mesh.points[face, 2] > middle
        if above.all() or not above.any():
            ends.setdefault(owner, {})[bool(above[0])] = face
    cells = []
    for cell in range(mesh.cells):
        low, high = ends[cell][False], ends[cell][True]
        # Above each corner of the lower face stands the one of the upper face that is nearest to it.
        apart = np.linalg.norm(mesh.points[low][:, None] - mesh.points[high][None], axis=2)
        cells.append(np.concatenate((low, high[apart.argmin(axis=1)])))
    return np.array(cells)


def _write_internal(path: Path, solution: Solution, time: str) -> None:
    mesh, cells = solution.mesh, _hexahedra(solution.mesh)
    count = len(cells)
    piece = f"<Piece NumberOfPoints='{len(mesh.points)}' NumberOfCells='{count}'>\n<Points>\n"
    piece += _array("Points", mesh.points, "Float32") + "</Points>\n<Cells>\n"
    piece += _array("connectivity", cells.ravel(), "Int32")
    piece += _array("offsets", _CORNERS * np.arange(1, count + 1), "Int32")
    piece += _array("types", np.full(count, _HEXAHEDRON), "UInt8") + "</Cells>\n<CellData>\n"
    piece += _array("U", solution.velocity.values, "Float32") + "</CellData>\n</Piece>\n"
    told = f"<FieldData>\n{_array('TimeValue', np.array([float(time)]), 'Float32')}</FieldData>\n"
    _write(path, "UnstructuredGrid", told + piece)


def _write_patch(path: Path, solution: Solution, name: str) -> None:
    mesh = solution.mesh
    patch = next(one for one in mesh.patches if one.name == name)
    faces = _faces(mesh)[patch.start : patch.start + patch.faces]
    ends = np.cumsum([face.size for face in faces])
    piece = f"<Piece NumberOfPoints='{len(mesh.points)}' NumberOfPolys='{len(faces)}'>\n<Points>\n"
    piece += _array("Points", mesh.points, "Float32") + "</Points>\n<Polys>\n"
    piece += _array("connectivity", np.concatenate(faces), "Int32")
    piece += _array("offsets", ends, "Int32") + "</Polys>\n<CellData>\n"
    piece += _array("U", solution.on_patch(patch), "Float32") + "</CellData>\n</Piece>\n"
    _write(path, "PolyData", piece)


def _array(name: str, values: Array, kind: str) -> str:
    width = f" NumberOfComponents='{values.shape[1]}'" if values.ndim == 2 else ""
    single = values.astype(np.float32) if kind == "Float32" else values
    numbers = " ".join(str(number) for number in single.ravel().tolist())
    return (
        f"<DataArray type='{kind}' Name='{name}'{width} format='ascii'>\n{numbers}\n</DataArray>\n"
    )


def _write(path: Path, kind: str, body: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    head = f"<VTKFile type='{kind}' version='0.1' byte_order='LittleEndian' header_type='UInt64'>\n"
    path.write_text(f"<?xml version='1.0'?>\n{head}<{kind}>\n{body}</{kind}>\n</VTKFile>\n")
