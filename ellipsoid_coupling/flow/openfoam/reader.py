"""Read solved plane cases: OpenFOAM's own folders, and foamToVTK's files by meshio and pyvista.

pyvista and meshio are imported in this file only, and only for foamToVTK's files: importing them takes
longer than computing a small scene. Both convert to single precision, or keep the precision of a file.
So the libraries get coordinates relative to the mesh's lower corner, and a case's own files are read
in double precision without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.extras import require
from ellipsoid_coupling.files.limits import MOST_PATCHES
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.mesh_flow import flow_field
from ellipsoid_coupling.flow.openfoam.case import Mesh, Solution, read_cells, read_solution
from ellipsoid_coupling.flow.openfoam.decomposed import whole_case
from ellipsoid_coupling.flow.openfoam.files import decimal, packed
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.plane_mesh import Raw, of_case, of_vtk
from ellipsoid_coupling.flow.openfoam.times import Chosen, unsolved
from ellipsoid_coupling.flow.openfoam.vtk_files import REMEDY, check_internal, read_patch
from ellipsoid_coupling.flow.openfoam.vtk_times import is_vtk, last_step, vtk_folder
from ellipsoid_coupling.flow.when import Divergence

Array = NDArray[np.float64]


class Sources(NamedTuple):
    """What a field is made from: the files, the beginning of its `origin`, and the case for messages."""

    files: tuple[Path, ...]
    origin: str
    where: str


def read_flow(
    path: Path, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
) -> FlowField:
    """The flow at a path: a case, one of its times, or the output of foamToVTK for one.

    A case may be named by its folder, a .foam or .OpenFOAM file in it, system/controlDict, or a
    time's folder. Parameters and errors as `read_case` and `read_vtk`.
    """
    read = read_vtk if is_vtk(path) else read_case
    return read(path, allow_misfit=allow_misfit, divergence=divergence)


@contextmanager
def sources(path: Path) -> Iterator[Sources]:
    """The files that `read_flow` would read at a path; InputError where there is no case.

    Those of a decomposed case are put together for as long as the context lasts.
    """
    if is_vtk(path):
        step = last_step(vtk_folder(path))
        boundary = islice((step / "boundary").glob("*.vtp"), MOST_PATCHES)
        yield Sources((step / "internal.vtu", *sorted(boundary)), _vtk_origin(step), str(step))
        return
    case, wanted = locate(path)
    with whole_case(case, wanted) as chosen:
        time, points, faces = chosen.places
        mesh = (faces / name for name in ("faces", "owner", "neighbour", "boundary"))
        wanted_files = [time / "U", time / "phi", points / "points", *mesh]
        if chosen.before is not None:
            wanted_files.append(chosen.before / "U")
        found = (packed(file) for file in wanted_files)
        files = tuple(file for file in found if file is not None)
        yield Sources(files, _case_origin(case, chosen), str(case))


def read_case(
    folder: Path, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
) -> FlowField:
    """The flow of a solved plane OpenFOAM case at its last time with a velocity, or at the one named.

    Parameters
    ----------
    folder : the case folder, a .foam file in it, or one of its times; nothing is written there
    allow_misfit : take it even where the field is more than `misfit.LARGEST_MISFIT` off U
    divergence : whether its sources are kept, for which it needs phi

    Raises InputError if the folder is missing or no case, if nothing has been solved, if the mesh is
    not a plane one, one cell thick, or if U is missing, not finite or not free of sources.
    """
    case, wanted = locate(folder)
    with whole_case(case, wanted) as chosen:
        solution = read_solution(chosen.places)
        change = _change(chosen, solution)
    if chosen.only_start and solution.velocity.uniform:
        raise unsolved(case, "no time beyond 0, where U is uniform")
    _require_no_wedge(case, solution.mesh)
    origin = _case_origin(case, chosen) + change
    made = partial(flow_field, allow_misfit=allow_misfit, divergence=divergence)
    return _field(lambda: made(of_case(solution, str(case), origin)), str(case))


def read_vtk(
    folder: Path, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
) -> FlowField:
    """The flow in the output of foamToVTK, its last time: internal.vtu and boundary/*.vtp.

    `folder` is that time's folder, the VTK folder, or the case. The rest as `read_case`.
    """
    step = last_step(vtk_folder(folder))
    raw = _read_vtu(step)
    made = partial(flow_field, allow_misfit=allow_misfit, divergence=divergence)
    return _field(lambda: made(of_vtk(raw, str(step), _vtk_origin(step))), str(step))


def _vtk_origin(step: Path) -> str:
    return f"foamToVTK folder {readable(step.resolve().name)}"


def _case_origin(case: Path, chosen: Chosen) -> str:
    return f"OpenFOAM case {readable(case.resolve().name)}, {chosen.note}"


def _field(made: Callable[[], FlowField], where: str) -> FlowField:
    """The field; InputError where the mesh's shape does not let one be made."""
    try:
        with np.errstate(all="ignore"):
            field = made()
    except (ValueError, RuntimeError, np.linalg.LinAlgError) as error:
        found = f"one on which that fails ({error})"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.") from None
    if not np.isfinite(field.arrays.coefficients).all():
        found = "one on which it is not finite"
        raise InputError(where, "a mesh to interpolate U on", found, "Mesh it again.")
    return field


def _error(where: Path, expected: str, found: str, remedy: str) -> InputError:
    return InputError(str(where), expected, found, remedy)


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


def _read_vtu(step: Path) -> Raw:
    """internal.vtu by meshio; the patches beside it are .vtp files of polygons."""
    require("meshio", "pyvista")
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
    offsets = np.concatenate(([0], np.cumsum(sizes)))
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
    return Raw(corner, points - corner, connectivity, offsets, velocity, patches)
