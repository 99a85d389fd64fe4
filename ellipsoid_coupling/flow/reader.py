"""Read solved plane OpenFOAM cases: case folders by pyvista, foamToVTK's files by meshio.

pyvista and meshio are imported in this file only, and only when a case is read: importing them
takes longer than computing a small scene.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.foam_case import read_solution, write_plain
from ellipsoid_coupling.flow.foam_files import packed
from ellipsoid_coupling.flow.mesh_flow import MeshFlow, flow_field
from ellipsoid_coupling.flow.polygons import Index, Polygons, polygons
from ellipsoid_coupling.flow.stream_function import Patch
from ellipsoid_coupling.flow.vtk_files import check_internal, read_patch
from ellipsoid_coupling.inputs import exists, is_folder
from ellipsoid_coupling.limits import MOST_TIMES

Array = NDArray[np.float64]

# 0, 0.5, 12, 1e-05, but not 0.orig
TIME = re.compile(r"\d+(\.\d+)?(e[-+]?\d+)?")


class _Cells(NamedTuple):
    """Cells by their points: those of cell k are points[offsets[k]:offsets[k+1]]."""

    points: Index
    offsets: Index


class _Raw(NamedTuple):
    """What both libraries give: 3-D points, cells, fields, patches (centres, velocity), all 3-D.

    psi is None where there is none, or none that VTK reads.
    """

    points: Array
    cells: _Cells
    psi: Array | None
    velocity: Array
    patches: Mapping[str, tuple[Array, Array]]


def read_case(folder: Path) -> FlowField:
    """The flow of a solved plane OpenFOAM case at its last time.

    Parameters
    ----------
    folder : the case folder, or a .foam file in it; nothing is written there

    Raises InputError if the folder is missing or no case, if only time 0 is there, if the mesh is
    more than one cell thick, or if U is missing, not finite or not free of sources.
    """
    case = folder.parent if folder.suffix == ".foam" else folder
    _require_case(case)
    time = _last_time(case)
    origin = f"OpenFOAM case {case.resolve().name}, time {time}"
    return _field(_read_foam(case, time), str(case), origin)


def read_vtk(folder: Path) -> FlowField:
    """The flow in what foamToVTK wrote, its last time: internal.vtu and boundary/*.vtp.

    `folder` is that time's folder, the VTK folder, or the case. Errors as `read_case`.
    """
    step = _vtk_step(folder)
    origin = f"foamToVTK folder {step.resolve().name}"
    return _field(_read_vtu(step), str(step), origin)


def _field(raw: _Raw, where: str, origin: str) -> FlowField:
    """The field; InputError where the mesh's shape does not let one be made."""
    try:
        with np.errstate(all="ignore"):
            field = flow_field(_plane(raw, where, origin))
    except (ValueError, np.linalg.LinAlgError, QhullError) as error:
        found = f"one on which that fails ({error})"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.") from None
    if not np.isfinite(field.arrays.coefficients).all():
        found = "one on which it is not finite"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.")
    return field


def _error(where: Path, expected: str, found: str, remedy: str) -> InputError:
    return InputError(str(where), expected, found, remedy)


def _require_case(case: Path) -> None:
    if not is_folder(case):
        raise _error(case, "a solved OpenFOAM case folder", "no such folder", "Check the path.")
    for part in ("system/controlDict", "constant/polyMesh/faces"):
        if packed(case / part) is None:
            raise _error(
                case, "an OpenFOAM case folder", f"no {part} in it",
                "Name the folder that holds constant, system and the times; mesh and solve it.",
            )  # fmt: skip


def _last_time(case: Path) -> str:
    """The name of the last time folder; time 0, where nothing has been solved, is refused."""
    folders = (path.name for path in islice(case.iterdir(), MOST_TIMES) if path.is_dir())
    times = sorted((name for name in folders if _is_time(name)), key=float)
    if not times or float(times[-1]) == 0.0:
        raise _error(
            case, "a solved case", "no time beyond 0",
            "Run the solver; after a parallel run, reconstructPar -latestTime.",
        )  # fmt: skip
    last = case / times[-1]
    if packed(last / "U") is None:
        expected = f"a velocity field U at time {times[-1]}"
        raise _error(case, expected, "none", "Let the solver write U.")
    if exists(last / "polyMesh"):
        raise _error(
            last, "a mesh that stays, in constant/polyMesh", "another one at this time",
            "Solve the flow on a fixed mesh.",
        )  # fmt: skip
    return times[-1]


def _is_time(name: str) -> bool:
    return len(name) < 50 and bool(TIME.fullmatch(name)) and math.isfinite(float(name))


def _read_foam(case: Path, time: str) -> _Raw:
    """The time `time` of a case, checked, by pyvista from a copy that holds nothing else."""
    import pyvista

    solution = read_solution(case, time)
    with TemporaryDirectory(prefix="ellipsoid-") as scratch, pyvista.vtk_verbosity("off"):
        plain = Path(scratch)
        write_plain(solution, plain)
        reader = pyvista.OpenFOAMReader(plain / "system" / "controlDict")
        reader.set_active_time_value(reader.time_values[-1])
        reader.cell_to_point_creation = False
        reader.enable_all_patch_arrays()
        blocks: Any = reader.read()
    mesh: Any = blocks["internalMesh"]
    if mesh is None or "U" not in mesh.cell_data or mesh.n_cells != solution.mesh.cells:
        raise _error(case, "a mesh that VTK reads", "another one", "Check constant/polyMesh.")
    boundary = blocks["boundary"]
    named = ((str(boundary.get_block_name(k)), boundary[k]) for k in range(boundary.n_blocks))
    patches = {name: _faces(patch) for name, patch in named if "U" in patch.cell_data}
    table = mesh.GetCells()
    cells = _Cells(
        np.asarray(pyvista.convert_array(table.GetConnectivityArray())),
        np.asarray(pyvista.convert_array(table.GetOffsetsArray())),
    )
    # One that is not finite is not handed to VTK.
    stream = mesh.point_data.get("streamFunction", solution.psi)
    psi = None if stream is None else np.asarray(stream)
    return _Raw(np.asarray(mesh.points), cells, psi, np.asarray(mesh.cell_data["U"]), patches)


def _faces(patch: Any) -> tuple[Array, Array]:
    """Centres (n, 3) and velocity (n, 3) of a patch's faces."""
    return np.asarray(patch.cell_centers().points), np.asarray(patch.cell_data["U"])


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
        "Run 'foamToVTK -latestTime' in the solved case and name its VTK folder.",
    )  # fmt: skip


def _read_vtu(step: Path) -> _Raw:
    """internal.vtu by meshio; the patches beside it are .vtp files of polygons."""
    import meshio
    import pyvista

    path = step / "internal.vtu"
    check_internal(path)
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio ends the program on some unreadable files
        remedy = "Run foamToVTK -latestTime again."
        raise _error(path, "a file that meshio reads", type(error).__name__, remedy) from error
    if float(np.ravel(mesh.field_data.get("TimeValue", 1.0))[0]) == 0.0:
        raise _error(step, "a solved case", "time 0 only", "Solve it, then foamToVTK -latestTime.")
    if "U" not in mesh.cell_data:
        raise _error(path, "a cell field U", "none", "Let the solver write U.")
    sizes = np.concatenate([np.full(len(b.data), b.data.shape[1]) for b in mesh.cells])
    connectivity = np.concatenate([np.ravel(b.data) for b in mesh.cells])
    cells = _Cells(connectivity, np.concatenate(([0], np.cumsum(sizes))))
    patches: dict[str, tuple[Array, Array]] = {}
    for file in sorted((step / "boundary").glob("*.vtp")):
        patch = read_patch(file)
        if patch.velocity is not None:
            # Decoded and checked there: VTK ends the program on broken files.
            first = np.cumsum(patch.sizes) - patch.sizes
            faces = np.insert(patch.corners, first, patch.sizes)
            polygon = pyvista.PolyData(patch.points, faces)
            patches[file.stem] = np.asarray(polygon.cell_centers().points), patch.velocity
    velocity = np.concatenate(mesh.cell_data["U"])
    return _Raw(mesh.points, cells, mesh.point_data.get("streamFunction"), velocity, patches)


def _plane(raw: _Raw, where: str, origin: str) -> MeshFlow:
    """The plane problem in a mesh that is one cell thick; InputError for any other mesh."""
    points = _decimal(raw.points)
    normal = _normal(points, where)
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
            patch = Patch(
                _decimal(at[between])[:, plane], velocity[between][:, plane].astype(float)
            )
            patches[name] = patch
    return MeshFlow(
        points=flat,
        edges=cells.edges(),
        psi=None if raw.psi is None else raw.psi[low].astype(np.float64),
        centres=cells.centroids(flat),
        velocity=raw.velocity[:, plane].astype(np.float64),
        patches=patches,
        contains=_Inside(flat, cells.triangles()),
        where=where,
        origin=origin,
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


def _decimal(points: Array) -> Array:
    """Single-precision coordinates as the decimal numbers they came from: 0.1, not 0.100000001."""
    return points.astype(np.float32).astype("U32").astype(np.float64)


def _normal(points: Array, where: str) -> int:
    """The axis along which the mesh is one cell thick, z first; InputError if there is none."""
    for axis in (2, 1, 0):
        depth = points[:, axis]
        tolerance = 1e-5 * np.ptp(depth)
        if np.all((depth - depth.min() <= tolerance) | (depth.max() - depth <= tolerance)):
            return axis
    raise InputError(
        where, "a plane case, one cell thick along x, y or z", "a 3-D mesh",
        "Solve the flow as a plane case, with empty patches in front and behind.",
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
