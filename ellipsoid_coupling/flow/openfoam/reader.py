"""Read solved plane OpenFOAM cases: case folders by pyvista, foamToVTK's files by meshio.

pyvista and meshio are imported in this file only, and only when a case is read: importing them
takes longer than computing a small scene. Both convert to single precision, or keep the precision of a
file. So coordinates and fields are read from the case in double precision, and the libraries get
coordinates relative to the mesh's lower corner.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.limits import MOST_PATCHES
from ellipsoid_coupling.files.reading import exists, is_folder, is_ordinary
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.mesh_flow import MeshFlow, flow_field
from ellipsoid_coupling.flow.openfoam.case import (
    Mesh,
    Solution,
    read_cells,
    read_solution,
    write_mesh,
)
from ellipsoid_coupling.flow.openfoam.files import decimal, packed
from ellipsoid_coupling.flow.openfoam.plane import SINGLE, thin_axis
from ellipsoid_coupling.flow.openfoam.times import Chosen, choose_time, is_time, unsolved
from ellipsoid_coupling.flow.openfoam.vtk_files import REMEDY, check_internal, read_patch
from ellipsoid_coupling.flow.polygons import Index, Polygons, polygons
from ellipsoid_coupling.flow.stream_function import Patch

Array = NDArray[np.float64]

# Paths that stand for the case around them.
_CASE_FILES = (".foam", ".OpenFOAM")
_VTK_FILES = (".vtk", ".vtu", ".vtp", ".vtm", ".pvd", ".series")


class _Cells(NamedTuple):
    """Cells by their points: those of cell k are points[offsets[k]:offsets[k+1]]."""

    points: Index
    offsets: Index


class _Raw(NamedTuple):
    """The contents of both formats: points, cells, fields, patches (centres, velocity), all 3-D.

    corner (3,) : the place in the case from which points and centres are measured
    """

    corner: Array
    points: Array
    cells: _Cells
    velocity: Array
    patches: Mapping[str, tuple[Array, Array]]


def read_flow(path: Path, *, allow_misfit: bool = False) -> FlowField:
    """The flow at a path: a case, one of its times, or the output of foamToVTK for one.

    A case may be named by its folder, a .foam or .OpenFOAM file in it, system/controlDict, or a
    time's folder. Parameters and errors as `read_case` and `read_vtk`.
    """
    folder = path.parent if path.name == "internal.vtu" else path
    no_case = is_folder(folder) and not is_folder(folder / "system")
    if no_case and (is_ordinary(folder / "internal.vtu") or any(folder.glob("*_*/internal.vtu"))):
        return read_vtk(folder, allow_misfit=allow_misfit)
    return read_case(path, allow_misfit=allow_misfit)


def read_case(folder: Path, *, allow_misfit: bool = False) -> FlowField:
    """The flow of a solved plane OpenFOAM case at its last time with a velocity, or at the one named.

    Parameters
    ----------
    folder : the case folder, a .foam file in it, or one of its times; nothing is written there
    allow_misfit : take it even where the field is more than `mesh_flow.LARGEST_MISFIT` off U

    Raises InputError if the folder is missing or no case, if nothing has been solved, if the mesh is
    not a plane one, one cell thick, or if U is missing, not finite or not free of sources.
    """
    case, wanted = located(folder)
    chosen = choose_time(case, wanted)
    solution = read_solution(chosen.places)
    if chosen.only_start and solution.velocity.uniform:
        raise unsolved(case, "no time beyond 0, where U is uniform")
    _require_no_wedge(case, solution.mesh)
    note = chosen.note + _change(chosen, solution)
    origin = f"OpenFOAM case {readable(case.resolve().name)}, {note}"
    return _field(_read_foam(case, solution), str(case), origin, allow_misfit)


def read_vtk(folder: Path, *, allow_misfit: bool = False) -> FlowField:
    """The flow in the output of foamToVTK, its last time: internal.vtu and boundary/*.vtp.

    `folder` is that time's folder, the VTK folder, or the case. The rest as `read_case`.
    """
    step = _vtk_step(folder)
    origin = f"foamToVTK folder {readable(step.resolve().name)}"
    return _field(_read_vtu(step), str(step), origin, allow_misfit)


def _field(raw: _Raw, where: str, origin: str, allow_misfit: bool) -> FlowField:
    """The field; InputError where the mesh's shape does not let one be made."""
    try:
        with np.errstate(all="ignore"):
            field = flow_field(_plane(raw, where, origin), allow_misfit=allow_misfit)
    except (ValueError, np.linalg.LinAlgError, QhullError) as error:
        found = f"one on which that fails ({error})"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.") from None
    if not np.isfinite(field.arrays.coefficients).all():
        found = "one on which it is not finite"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.")
    return field


def _error(where: Path, expected: str, found: str, remedy: str) -> InputError:
    return InputError(str(where), expected, found, remedy)


def located(path: Path) -> tuple[Path, str | None]:
    """The case that a path means, and the time, if it names one; InputError if it means none."""
    case, wanted = path, None
    if path.suffix in _CASE_FILES:
        case = path.parent
    elif path.parts[-2:] == ("system", "controlDict"):
        case = path.parent.parent
    elif is_folder(path) and is_time(path.resolve().name):
        around = path.resolve().parent
        if is_folder(around / "constant"):
            case, wanted = around, path.resolve().name
    if not is_folder(case):
        if path.suffix in _VTK_FILES and is_ordinary(path):
            raise _legacy(path)
        found = "something else" if exists(case) else "no such folder"
        raise _error(path, "a solved OpenFOAM case folder", found, "Check the path.")
    if packed(case / "system/controlDict") is None:
        if any(case.glob("*.vtk")):
            raise _legacy(case)
        remedy = "Name the folder that holds constant, system and the times; mesh and solve it."
        if re.fullmatch(r"processors?\d+(_\d+-\d+)?", case.resolve().name):
            remedy = "It is a part of a case: run reconstructPar there and name the whole case."
        raise _error(case, "an OpenFOAM case folder", "no system/controlDict in it", remedy)
    return case, wanted


def _legacy(path: Path) -> InputError:
    return _error(
        path, "a solved OpenFOAM case folder", "files for ParaView",
        "Name the folder of the case itself: its mesh and U are read from there, in full precision.",
    )  # fmt: skip


def _require_no_wedge(case: Path, mesh: Mesh) -> None:
    wedges = [patch.name for patch in mesh.patches if patch.kind == "wedge"]
    if wedges:
        raise _error(
            case, "a plane case, with empty patches in front and behind",
            f"an axisymmetric one, with wedge patches ({', '.join(wedges[:4])})",
            "Solve the flow between parallel planes.",
        )  # fmt: skip


def _change(chosen: Chosen, solution: Solution) -> str:
    """How much U has changed since the solved time before, in words; nothing if there is none."""
    if chosen.before is None:
        return ""
    since = f"since time {chosen.before.name}"
    try:
        before = read_cells(chosen.before / "U", solution.mesh)
    except InputError:
        return f", its change {since} not known as U there is of another kind"
    now = solution.velocity.values
    largest = max(float(np.linalg.norm(now)), float(np.linalg.norm(before)))
    change = float(np.linalg.norm(now - before)) / largest if largest > 0.0 else 0.0
    return f", changed by {100.0 * change:.2g} % {since}"


def _read_foam(case: Path, solution: Solution) -> _Raw:
    """A checked case as both formats give it; the cells' points are those that pyvista finds."""
    import pyvista

    corner = solution.mesh.points.min(axis=0)
    mesh = solution.mesh._replace(points=solution.mesh.points - corner)
    with TemporaryDirectory(prefix="ellipsoid-") as scratch, pyvista.vtk_verbosity("off"):
        plain = Path(scratch)
        write_mesh(mesh, plain)
        reader = pyvista.OpenFOAMReader(plain / "system" / "controlDict")
        reader.set_active_time_value(reader.time_values[-1])
        reader.cell_to_point_creation = False
        blocks: Any = reader.read()
    read: Any = blocks["internalMesh"]
    size = float(np.ptp(mesh.points, axis=0).max())
    same = read is not None and read.n_cells == mesh.cells and read.n_points == len(mesh.points)
    if not same or np.abs(read.points - mesh.points).max() > SINGLE * size:
        raise _error(case, "a mesh that VTK reads", "another one", "Check constant/polyMesh.")
    table = read.GetCells()
    cells = _Cells(
        np.asarray(pyvista.convert_array(table.GetConnectivityArray())),
        np.asarray(pyvista.convert_array(table.GetOffsetsArray())),
    )
    patches = {
        patch.name: (mesh.face_centres(patch), solution.on_patch(patch))
        for patch in mesh.patches
        if patch.kind != "empty"
    }
    return _Raw(corner, mesh.points, cells, solution.velocity.values, patches)


def _vtk_step(folder: Path) -> Path:
    """The folder of foamToVTK's last time: it holds internal.vtu and its name ends in the index."""
    if (folder / "internal.vtu").is_file():
        return folder
    for parent in (folder, folder / "VTK"):
        steps = [path.parent for path in parent.glob("*_*/internal.vtu")]
        numbered = [step for step in steps if re.search(r"_\d{1,18}$", step.name)]
        if numbered:
            return max(numbered, key=lambda step: int(step.name.rpartition("_")[2]))
    raise _error(
        folder, "what foamToVTK wrote (internal.vtu in it or below it)", "none",
        "Name the folder of the solved case itself.",
    )  # fmt: skip


def _read_vtu(step: Path) -> _Raw:
    """internal.vtu by meshio; the patches beside it are .vtp files of polygons."""
    import meshio
    import pyvista

    path = step / "internal.vtu"
    check_internal(path)
    try:
        # Its messages quote the file, markup for terminals included.
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio ends the program on some unreadable files
        raise _error(path, "a file that meshio reads", type(error).__name__, REMEDY) from error
    if "U" not in mesh.cell_data:
        raise _error(path, "a cell field U", "none", "Let the solver write U.")
    velocity = np.concatenate(mesh.cell_data["U"]).astype(np.float64)
    time = float(np.ravel(mesh.field_data.get("TimeValue", 1.0))[0])
    if time == 0.0 and not np.ptp(velocity, axis=0).any():
        found = "time 0 only, where U is uniform"
        raise _error(step, "a solved case", found, "Solve it, then foamToVTK -latestTime.")
    sizes = np.concatenate([np.full(len(b.data), b.data.shape[1]) for b in mesh.cells])
    connectivity = np.concatenate([np.ravel(b.data) for b in mesh.cells])
    cells = _Cells(connectivity, np.concatenate(([0], np.cumsum(sizes))))
    points = decimal(mesh.points) if mesh.points.dtype == np.float32 else mesh.points
    corner = points.min(axis=0)
    patches: dict[str, tuple[Array, Array]] = {}
    for file in sorted(islice((step / "boundary").glob("*.vtp"), MOST_PATCHES)):
        patch = read_patch(file)
        if patch.velocity is not None:
            # Decoded and checked there: VTK ends the program on broken files.
            first = np.cumsum(patch.sizes) - patch.sizes
            faces = np.insert(patch.corners, first, patch.sizes)
            polygon = pyvista.PolyData(patch.points - corner, faces)
            patches[file.stem] = np.asarray(polygon.cell_centers().points), patch.velocity
    return _Raw(corner, points - corner, cells, velocity, patches)


def _plane(raw: _Raw, where: str, origin: str) -> MeshFlow:
    """The plane problem in a mesh that is one cell thick; InputError for any other mesh."""
    points = raw.points
    normal = thin_axis(points, where)
    plane = [axis for axis in range(3) if axis != normal]
    depth = points[:, normal]
    middle = 0.5 * (depth.min() + depth.max())
    low = depth < middle
    count = raw.cells.offsets.size - 1
    owner = np.repeat(np.arange(count), np.diff(raw.cells.offsets))
    kept = low[raw.cells.points]
    # The lower plane's points, numbered as they come.
    corner = (np.cumsum(low) - 1)[raw.cells.points[kept]]
    flat = points[low][:, plane]
    cells = polygons(flat, corner, owner[kept], count)
    _require_areas(flat, cells, where)
    patches = {}
    for name, (at, velocity) in raw.patches.items():
        # Faces of the empty patch lie on the planes in front and behind, not between them.
        between = np.abs(at[:, normal] - middle) < 0.25 * np.ptp(depth)
        if between.any():
            patches[name] = Patch(at[between][:, plane], velocity[between][:, plane])
    return MeshFlow(
        points=flat,
        edges=cells.edges(),
        centres=cells.centroids(flat),
        velocity=raw.velocity[:, plane],
        patches=patches,
        contains=_Inside(flat, cells.triangles()),
        where=where,
        origin=origin,
        corner=raw.corner[plane],
    )


def _require_areas(points: Array, cells: Polygons, where: str) -> None:
    """InputError unless every cell, seen along the mesh's thickness, has an area and no edge is 0."""
    ends = points[cells.edges().points]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    a, b, c = np.moveaxis(points[cells.triangles()], 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    area = np.bincount(cells.triangle_owners(), twice, cells.sizes.size)
    # Smaller ones are 0 but for the rounding of single precision.
    least = 1e-6 * float(np.ptp(points, axis=0).max(initial=0.0))
    flawed = np.count_nonzero(~(area > least**2))
    if flawed or not length.size or not length.min() > least:
        raise InputError(
            where, "cells with an area and edges with a length",
            f"{flawed} cells without, the shortest edge {length.min(initial=np.inf):g} long",
            "Mesh the case again.",
        )  # fmt: skip


class _Inside:
    """Tells which points (n, 2) lie in a plane mesh given by triangles (T, 3) on points (P, 2)."""

    def __init__(self, points: Array, triangles: Index) -> None:
        self.points, self.triangles = points, triangles

    def __call__(self, at: Array) -> NDArray[np.bool_]:
        import pyvista

        flat = [np.column_stack((p, np.zeros(len(p)))) for p in (self.points, at)]
        mesh = pyvista.PolyData.from_regular_faces(flat[0], self.triangles.tolist())
        # static_cell: the obb_tree locator hangs on plane meshes.
        sample: Any = pyvista.PolyData(flat[1]).sample(mesh, locator="static_cell")
        return np.asarray(sample.point_data["vtkValidPointMask"]).astype(bool)
